# efsi_compile_options(target): warnings and floating-point rules of every target of the project; no file holds the place of
# the checkout.
function(efsi_compile_options target)
  target_compile_options(${target} PRIVATE "-ffile-prefix-map=${PROJECT_SOURCE_DIR}/=")
  target_compile_options(${target} PRIVATE -ffp-contract=off -Wall -Wextra -Wpedantic -Wshadow)
  # Nothing reads errno, which keeps loops with a sqrt from being vectorised. Short vectors (grid/packed_field.hpp) are
  # passed between inlined functions only.
  target_compile_options(${target} PRIVATE -fno-math-errno $<$<CXX_COMPILER_ID:GNU>:-Wno-psabi>)
  if(EFSI_STRICT)
    target_compile_options(${target} PRIVATE -Werror)
  endif()
endfunction()
