// Purpose: loaded before a run (LD_PRELOAD), ends it by SIGKILL at its n-th change of a file below a folder, a write
// half-way, and makes the wall clock jump. tests/python/crashes.py starts it.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/uio.h>
#include <time.h>
#include <unistd.h>

static char root[PATH_MAX];
static atomic_long changes, last = -1;
static atomic_int jumps;

// From now on changes below `folder` are counted; the process dies at number `at`, 0: never.
void crash_at(const char* folder, long at) {
  atomic_store(&changes, 0);
  atomic_store(&last, at);
  snprintf(root, sizeof root, "%s/", folder);
}
long crash_changes(void) { return atomic_load(&changes); }

// From now on every look at the wall clock finds it years before or after the last one.
void crash_clock(void) { atomic_store(&jumps, 1); }

static int below(const char* path) { return root[0] && path && strncmp(path, root, strlen(root)) == 0; }

static int open_below(int fd) {
  char link[64], path[PATH_MAX];
  if (!root[0]) return 0;
  snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
  const ssize_t length = readlink(link, path, sizeof path - 1);
  if (length < 0) return 0;
  path[length] = 0;
  return below(path);
}

static int is_last(void) { return atomic_fetch_add(&changes, 1) + 1 == atomic_load(&last); }

static void die(void) {
  kill(getpid(), SIGKILL);
  for (;;) pause();
}

#define REAL(name, type) ((type)dlsym(RTLD_NEXT, #name))
#define CHANGES(condition) \
  if ((condition) && is_last()) die()

ssize_t write(int fd, const void* data, size_t size) {
  ssize_t (*real)(int, const void*, size_t) = REAL(write, ssize_t(*)(int, const void*, size_t));
  if (open_below(fd) && is_last()) {
    real(fd, data, size / 2);
    die();
  }
  return real(fd, data, size);
}

ssize_t writev(int fd, const struct iovec* parts, int count) {
  ssize_t (*real)(int, const struct iovec*, int) = REAL(writev, ssize_t(*)(int, const struct iovec*, int));
  if (open_below(fd) && is_last()) {
    real(fd, parts, count / 2);
    die();
  }
  return real(fd, parts, count);
}

ssize_t pwrite64(int fd, const void* data, size_t size, off64_t at) {
  ssize_t (*real)(int, const void*, size_t, off64_t) = REAL(pwrite64, ssize_t(*)(int, const void*, size_t, off64_t));
  if (open_below(fd) && is_last()) {
    real(fd, data, size / 2, at);
    die();
  }
  return real(fd, data, size, at);
}
ssize_t pwrite(int fd, const void* data, size_t size, off_t at) { return pwrite64(fd, data, size, at); }

int rename(const char* from, const char* to) {
  CHANGES(below(to));
  return REAL(rename, int (*)(const char*, const char*))(from, to);
}
int unlink(const char* path) {
  CHANGES(below(path));
  return REAL(unlink, int (*)(const char*))(path);
}
int unlinkat(int folder, const char* path, int flags) {
  CHANGES(below(path) || open_below(folder));
  return REAL(unlinkat, int (*)(int, const char*, int))(folder, path, flags);
}
int fsync(int fd) {
  CHANGES(open_below(fd));
  return REAL(fsync, int (*)(int))(fd);
}
int truncate64(const char* path, off64_t size) {
  CHANGES(below(path));
  return REAL(truncate64, int (*)(const char*, off64_t))(path, size);
}
int ftruncate64(int fd, off64_t size) {
  CHANGES(open_below(fd));
  return REAL(ftruncate64, int (*)(int, off64_t))(fd, size);
}
int mkdir(const char* path, mode_t mode) {
  CHANGES(below(path));
  return REAL(mkdir, int (*)(const char*, mode_t))(path, mode);
}
int open64(const char* path, int flags, ...) {
  va_list rest;
  va_start(rest, flags);
  const int mode = flags & O_CREAT ? va_arg(rest, int) : 0;
  va_end(rest);
  CHANGES((flags & O_CREAT) && below(path));
  return REAL(open64, int (*)(const char*, int, ...))(path, flags, mode);
}

int clock_gettime(clockid_t which, struct timespec* now) {
  const int status = REAL(clock_gettime, int (*)(clockid_t, struct timespec*))(which, now);
  if (status == 0 && which == CLOCK_REALTIME && atomic_load(&jumps)) {
    const int number = atomic_fetch_add(&jumps, 1);
    now->tv_sec += (number % 2 ? 1 : -1) * 31536000L * (1 + number % 7);
  }
  return status;
}
