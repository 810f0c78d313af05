// Purpose: marks a hot loop that is compiled for several instruction sets; the best one is chosen when the library is
// loaded. Contraction and reordering are off everywhere, so all of them give the same bits. A build with assertions has
// the basic set alone.
#pragma once

#if defined(__x86_64__) && defined(__GNUC__) && !defined(__clang__) && !defined(__SANITIZE_ADDRESS__) && \
    defined(__OPTIMIZE__) && defined(NDEBUG)
#define EFSI_KERNEL __attribute__((target_clones("avx512f", "avx2", "default")))
#else
#define EFSI_KERNEL
#endif

// Small functions and lambdas of hot loops that the compiler would otherwise call: a lambda by itself knows nothing of
// the instruction set of the kernel around it.
#if defined(__GNUC__) && defined(__OPTIMIZE__)
#define EFSI_INLINE inline __attribute__((always_inline))
#define EFSI_INLINE_LAMBDA __attribute__((always_inline))
#else
#define EFSI_INLINE inline
#define EFSI_INLINE_LAMBDA
#endif
