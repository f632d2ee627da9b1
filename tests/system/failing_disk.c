// Preloaded into a station (LD_PRELOAD): a disk whose writes and syncs fail, and whose syncs are slow.
//
// RHEONAUT_DISK_FOLDER: files below it are on this disk. RHEONAUT_DISK_FAULTS: a file of five int32, which a test changes
// at any time: error of writes, error of syncs (errno, 0: none), delay of syncs in ms, how many calls of 100 fail, and the
// number of calls that have failed. Half of a write that fails reaches the file.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mman.h>
#include <sys/vfs.h>
#include <time.h>
#include <unistd.h>

struct faults {
  _Atomic int32_t write_error, sync_error, sync_delay_ms, percent, failed;
};

static struct faults *faults;
static const char *folder;

__attribute__((constructor)) static void begin(void) {
  const char *path = getenv("RHEONAUT_DISK_FAULTS");
  folder = getenv("RHEONAUT_DISK_FOLDER");
  if (path == NULL || folder == NULL) return;
  const int file = open(path, O_RDWR | O_CLOEXEC);
  if (file < 0) return;
  void *at = mmap(NULL, sizeof(struct faults), PROT_READ | PROT_WRITE, MAP_SHARED, file, 0);
  close(file);
  if (at != MAP_FAILED) faults = at;
}

static int is_on_this_disk(int file) {
  char name[40], path[1024];
  snprintf(name, sizeof name, "/proc/self/fd/%d", file);
  const ssize_t length = readlink(name, path, sizeof path - 1);
  if (length < 0) return 0;
  path[length] = '\0';
  return strncmp(path, folder, strlen(folder)) == 0;
}

static int fails(int error) {
  static _Thread_local uint32_t random = 0;
  if (error == 0) return 0;
  if (random == 0) random = (uint32_t)time(NULL) ^ (uint32_t)(uintptr_t)&random;
  random = random * 1664525u + 1013904223u;
  if ((int32_t)(random >> 8) % 100 >= faults->percent) return 0;
  ++faults->failed;
  return 1;
}

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

ssize_t pwrite64(int file, const void *bytes, size_t size, off64_t at) {
  if (faults != NULL && faults->write_error != 0 && is_on_this_disk(file) && fails(faults->write_error)) {
    if (size > 1) (void)!REAL(pwrite64)(file, bytes, size / 2, at);
    errno = faults->write_error;
    return -1;
  }
  return REAL(pwrite64)(file, bytes, size, at);
}

ssize_t pwrite(int file, const void *bytes, size_t size, off_t at) { return pwrite64(file, bytes, size, at); }

ssize_t write(int file, const void *bytes, size_t size) {
  if (faults != NULL && faults->write_error != 0 && is_on_this_disk(file) && fails(faults->write_error)) {
    if (size > 1) (void)!REAL(write)(file, bytes, size / 2);
    errno = faults->write_error;
    return -1;
  }
  return REAL(write)(file, bytes, size);
}

static int sync_of(int file, int (*real)(int)) {
  if (faults == NULL || !is_on_this_disk(file)) return real(file);
  const int32_t delay_ms = faults->sync_delay_ms;
  if (delay_ms > 0) {
    const struct timespec delay = {delay_ms / 1000, (delay_ms % 1000) * 1000000L};
    nanosleep(&delay, NULL);
  }
  if (fails(faults->sync_error)) {
    errno = faults->sync_error;
    return -1;
  }
  return real(file);
}

int fsync(int file) { return sync_of(file, REAL(fsync)); }
int fdatasync(int file) { return sync_of(file, REAL(fdatasync)); }

// RHEONAUT_DISK_TYPE: what statfs(2) says of every file system, e.g. 0x6969 for NFS.
int statfs(const char *path, struct statfs *about) {
  const char *type = getenv("RHEONAUT_DISK_TYPE");
  const int answer = REAL(statfs)(path, about);
  if (type != NULL && answer == 0) about->f_type = (__typeof__(about->f_type))strtoull(type, NULL, 0);
  return answer;
}
