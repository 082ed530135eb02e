/* A disk on which one call fails, for tests that preload it into the program (failing_disk_test.py).
 *
 * FAILING_DISK_ROOT   only files below this folder count (names in the calls must begin with it)
 * FAILING_DISK_CALL   write, sync, rename, open, close, mkdir or truncate
 * FAILING_DISK_AT     the number of the call of that kind that fails, from 1; 0: none
 * FAILING_DISK_STAYS  1: all later ones fail too, as on a full disk
 * FAILING_DISK_LOG    file that gets a line with the number of calls of each kind at the end
 * FAILING_DISK_LOCKS  none: flock() and fcntl() locks fail with ENOSYS, wherever the file is
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <unistd.h>

enum kind { kWrite, kSync, kRename, kOpen, kClose, kMkdir, kTruncate, kKinds };
static const char* const kNames[kKinds] = {"write", "sync",  "rename",  "open",
                                           "close", "mkdir", "truncate"};
static const int kErrors[kKinds] = {ENOSPC, EIO, EIO, EMFILE, EIO, ENOSPC, EIO};
static atomic_int counts[kKinds];

static const char* variable(const char* name) {
  const char* value = getenv(name);
  return value != NULL ? value : "";
}

static int is_below_root(const char* path) {
  const char* root = variable("FAILING_DISK_ROOT");
  const size_t length = strlen(root);
  return length > 0 && strncmp(path, root, length) == 0;
}

static int is_on_disk(int descriptor) {
  char name[64];
  char path[PATH_MAX];
  snprintf(name, sizeof name, "/proc/self/fd/%d", descriptor);
  const ssize_t length = readlink(name, path, sizeof path - 1);
  if (length < 0) return 0;
  path[length] = 0;
  return is_below_root(path);
}

/* 1, with errno set, when this call is to fail. */
static int fails(enum kind kind) {
  const int number = atomic_fetch_add(&counts[kind], 1) + 1;
  if (strcmp(variable("FAILING_DISK_CALL"), kNames[kind]) != 0) return 0;
  const int at = atoi(variable("FAILING_DISK_AT"));
  if (at == 0 || number < at) return 0;
  if (number > at && strcmp(variable("FAILING_DISK_STAYS"), "1") != 0) return 0;
  errno = kErrors[kind];
  return 1;
}

__attribute__((destructor)) static void write_counts(void) {
  const char* path = variable("FAILING_DISK_LOG");
  FILE* file = *path != 0 ? fopen(path, "w") : NULL;
  if (file == NULL) return;
  for (int kind = 0; kind < kKinds; ++kind) {
    fprintf(file, "%s %d\n", kNames[kind], atomic_load(&counts[kind]));
  }
  fclose(file);
}

#define NEXT(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))
ssize_t write(int fd, const void* bytes, size_t count) {
  if (is_on_disk(fd) && fails(kWrite)) return -1;
  return NEXT(write)(fd, bytes, count);
}
ssize_t pwrite(int fd, const void* bytes, size_t count, off_t offset) {
  if (is_on_disk(fd) && fails(kWrite)) return -1;
  return NEXT(pwrite)(fd, bytes, count, offset);
}
ssize_t pwrite64(int fd, const void* bytes, size_t count, off64_t offset) {
  if (is_on_disk(fd) && fails(kWrite)) return -1;
  return NEXT(pwrite64)(fd, bytes, count, offset);
}
int fsync(int fd) {
  if (is_on_disk(fd) && fails(kSync)) return -1;
  return NEXT(fsync)(fd);
}
int fdatasync(int fd) {
  if (is_on_disk(fd) && fails(kSync)) return -1;
  return NEXT(fdatasync)(fd);
}
int syncfs(int fd) {
  if (is_on_disk(fd) && fails(kSync)) return -1;
  /* The machine's other work is no part of the test. */
  return 0;
}
int ftruncate(int fd, off_t length) {
  if (is_on_disk(fd) && fails(kTruncate)) return -1;
  return NEXT(ftruncate)(fd, length);
}
int ftruncate64(int fd, off64_t length) {
  if (is_on_disk(fd) && fails(kTruncate)) return -1;
  return NEXT(ftruncate64)(fd, length);
}
int close(int fd) {
  const int is_to_fail = is_on_disk(fd) && fails(kClose);
  const int result = NEXT(close)(fd);
  if (!is_to_fail) return result;
  errno = kErrors[kClose];
  return -1;
}
int rename(const char* from, const char* to) {
  if (is_below_root(to) && fails(kRename)) return -1;
  return NEXT(rename)(from, to);
}
int mkdir(const char* path, mode_t mode) {
  if (is_below_root(path) && fails(kMkdir)) return -1;
  return NEXT(mkdir)(path, mode);
}

static mode_t mode_of(int flags, va_list arguments) {
  return (flags & (O_CREAT | O_TMPFILE)) != 0 ? va_arg(arguments, mode_t) : 0;
}
int open(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  if (is_below_root(path) && fails(kOpen)) return -1;
  return NEXT(open)(path, flags, mode);
}
int open64(const char* path, int flags, ...) {
  va_list arguments;
  va_start(arguments, flags);
  const mode_t mode = mode_of(flags, arguments);
  va_end(arguments);
  if (is_below_root(path) && fails(kOpen)) return -1;
  return NEXT(open64)(path, flags, mode);
}

static int has_no_locks(void) { return strcmp(variable("FAILING_DISK_LOCKS"), "none") == 0; }
static int is_lock(int command) {
  return command == F_SETLK || command == F_SETLKW || command == F_GETLK;
}
int flock(int fd, int operation) {
  if (has_no_locks()) {
    errno = ENOSYS;
    return -1;
  }
  return ((int (*)(int, int))dlsym(RTLD_NEXT, "flock"))(fd, operation);
}
#define FCNTL(name)                                                                  \
  int name(int fd, int command, ...) {                                               \
    va_list arguments;                                                               \
    va_start(arguments, command);                                                    \
    void* argument = va_arg(arguments, void*);                                       \
    va_end(arguments);                                                               \
    if (is_lock(command) && has_no_locks()) {                                        \
      errno = ENOSYS;                                                                \
      return -1;                                                                     \
    }                                                                                \
    return ((int (*)(int, int, ...))dlsym(RTLD_NEXT, #name))(fd, command, argument); \
  }
FCNTL(fcntl)
FCNTL(fcntl64)
