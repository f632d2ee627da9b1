// The functions of sqlite3_vfs and sqlite3_io_methods, in the order of sqlite3.h.
#include "tests/server/recording/forgetful_vfs.hpp"

#include <filesystem>
#include <new>

namespace server {
namespace {

std::string_view kind_of(std::string_view path) {
  return path.ends_with("-wal") ? "log" : path.ends_with("-journal") ? "journal" : "database";
}

}  // namespace

// What belongs to one sqlite3_file of ours. The real file lies behind it in the memory that SQLite gives.
struct ForgetfulVfs::OpenFile {
  ForgetfulVfs& vfs;
  std::string path;
  std::shared_ptr<DiskFile> disk_file;  // null for temporary files, which nobody expects to survive
  bool syncs_folder = false;  // with its first sync, as the system's VFS does for a journal or log that it may create
};

struct ForgetfulVfs::Shim {
  struct File {
    sqlite3_file base;
    OpenFile* open;
  };

  static OpenFile& opened(sqlite3_file* file) { return *reinterpret_cast<File*>(file)->open; }
  static sqlite3_file* real(sqlite3_file* file) {
    return reinterpret_cast<sqlite3_file*>(reinterpret_cast<File*>(file) + 1);
  }
  static ForgetfulVfs& self(sqlite3_vfs* vfs) { return *static_cast<ForgetfulVfs*>(vfs->pAppData); }
  static bool is_off(sqlite3_file* file) { return opened(file).vfs.has_failed(); }

  static int open(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* out_flags);
  static int remove(sqlite3_vfs* vfs, const char* path, int sync_folder);
  static int access(sqlite3_vfs* vfs, const char* path, int flags, int* result);

  static int close(sqlite3_file* file);
  static int read(sqlite3_file* file, void* bytes, int count, sqlite3_int64 offset);
  static int write(sqlite3_file* file, const void* bytes, int count, sqlite3_int64 offset);
  static int truncate(sqlite3_file* file, sqlite3_int64 size);
  static int sync(sqlite3_file* file, int flags);
  static int file_size(sqlite3_file* file, sqlite3_int64* size);
  static int lock(sqlite3_file* file, int level);
  static int unlock(sqlite3_file* file, int level);
  static int check_reserved_lock(sqlite3_file* file, int* result);
  static int file_control(sqlite3_file* file, int operation, void* argument);
  static int sector_size(sqlite3_file* file);
  static int device_characteristics(sqlite3_file* file);
  static int shm_map(sqlite3_file* file, int page, int page_size, int extend, void volatile** memory);
  static int shm_lock(sqlite3_file* file, int offset, int count, int flags);
  static void shm_barrier(sqlite3_file* file);
  static int shm_unmap(sqlite3_file* file, int remove);

  static const sqlite3_io_methods kMethods;
};

int ForgetfulVfs::Shim::open(sqlite3_vfs* vfs, const char* path, sqlite3_file* file, int flags, int* out_flags) {
  constexpr int kRemembered = SQLITE_OPEN_MAIN_DB | SQLITE_OPEN_MAIN_JOURNAL | SQLITE_OPEN_WAL;
  ForgetfulVfs& our = self(vfs);
  const std::scoped_lock lock{our.mutex_};
  file->pMethods = nullptr;
  if (our.has_failed_) return SQLITE_IOERR;
  std::shared_ptr<DiskFile> disk_file;
  if (path != nullptr && (flags & kRemembered) != 0) {
    const bool is_there = our.disk_.exists(path) || std::filesystem::exists(path);
    if (!is_there && (flags & SQLITE_OPEN_CREATE) == 0) return SQLITE_CANTOPEN;
    disk_file = our.disk_.open(path);
  }
  const int result = our.real_->xOpen(our.real_, path, real(file), flags, out_flags);
  if (result != SQLITE_OK) return result;
  const bool syncs_folder = (flags & SQLITE_OPEN_CREATE) != 0 && (flags & SQLITE_OPEN_MAIN_DB) == 0;
  reinterpret_cast<File*>(file)->open =
      new OpenFile{our, path == nullptr ? "" : path, std::move(disk_file), syncs_folder};
  file->pMethods = &kMethods;
  return SQLITE_OK;
}

int ForgetfulVfs::Shim::remove(sqlite3_vfs* vfs, const char* path, int sync_folder) {
  ForgetfulVfs& our = self(vfs);
  const std::scoped_lock lock{our.mutex_};
  if (our.has_failed_) return SQLITE_IOERR;
  const int result = our.real_->xDelete(our.real_, path, 0);
  if (!our.disk_.exists(path)) return result;
  our.disk_.remove(path);
  if (our.count_call("removal", path)) return SQLITE_IOERR;
  if (sync_folder != 0) our.disk_.sync_folder();
  return result;
}

int ForgetfulVfs::Shim::access(sqlite3_vfs* vfs, const char* path, int flags, int* result) {
  if (self(vfs).has_failed()) return SQLITE_IOERR;
  return self(vfs).real_->xAccess(self(vfs).real_, path, flags, result);
}

int ForgetfulVfs::Shim::close(sqlite3_file* file) {
  const int result = real(file)->pMethods->xClose(real(file));
  delete &opened(file);
  return result;
}

int ForgetfulVfs::Shim::read(sqlite3_file* file, void* bytes, int count, sqlite3_int64 offset) {
  if (is_off(file)) return SQLITE_IOERR;
  return real(file)->pMethods->xRead(real(file), bytes, count, offset);
}

int ForgetfulVfs::Shim::write(sqlite3_file* file, const void* bytes, int count, sqlite3_int64 offset) {
  OpenFile& opened_file = opened(file);
  ForgetfulVfs& our = opened_file.vfs;
  our.stand_still_if_held(opened_file);
  const std::scoped_lock lock{our.mutex_};
  if (our.has_failed_) return SQLITE_IOERR;
  if (opened_file.disk_file && our.refused_writes_ > 0) {
    --our.refused_writes_;
    return SQLITE_FULL;
  }
  const int result = real(file)->pMethods->xWrite(real(file), bytes, count, offset);
  if (!opened_file.disk_file || result != SQLITE_OK) return result;
  opened_file.disk_file->write(static_cast<std::uint64_t>(offset),
                               {static_cast<const char*>(bytes), static_cast<std::size_t>(count)});
  return our.count_call("write", opened_file.path) ? SQLITE_IOERR : SQLITE_OK;
}

int ForgetfulVfs::Shim::truncate(sqlite3_file* file, sqlite3_int64 size) {
  OpenFile& opened_file = opened(file);
  ForgetfulVfs& our = opened_file.vfs;
  const std::scoped_lock lock{our.mutex_};
  if (our.has_failed_) return SQLITE_IOERR;
  const int result = real(file)->pMethods->xTruncate(real(file), size);
  if (!opened_file.disk_file || result != SQLITE_OK) return result;
  opened_file.disk_file->truncate(static_cast<std::uint64_t>(size));
  return our.count_call("truncation", opened_file.path) ? SQLITE_IOERR : SQLITE_OK;
}

int ForgetfulVfs::Shim::sync(sqlite3_file* file, int) {
  OpenFile& opened_file = opened(file);
  ForgetfulVfs& our = opened_file.vfs;
  const std::scoped_lock lock{our.mutex_};
  if (our.has_failed_) return SQLITE_IOERR;
  if (!opened_file.disk_file) return SQLITE_OK;
  if (our.count_call("sync", opened_file.path)) return SQLITE_IOERR;
  our.disk_.sync(opened_file.path, opened_file.disk_file);
  if (opened_file.syncs_folder) our.disk_.sync_folder();
  opened_file.syncs_folder = false;
  return SQLITE_OK;
}

int ForgetfulVfs::Shim::file_size(sqlite3_file* file, sqlite3_int64* size) {
  if (is_off(file)) return SQLITE_IOERR;
  return real(file)->pMethods->xFileSize(real(file), size);
}

int ForgetfulVfs::Shim::lock(sqlite3_file* file, int level) {
  if (is_off(file)) return SQLITE_IOERR;
  return real(file)->pMethods->xLock(real(file), level);
}

// Locks are let go also without power, or no connection could be closed.
int ForgetfulVfs::Shim::unlock(sqlite3_file* file, int level) {
  return real(file)->pMethods->xUnlock(real(file), level);
}

int ForgetfulVfs::Shim::check_reserved_lock(sqlite3_file* file, int* result) {
  if (is_off(file)) return SQLITE_IOERR;
  return real(file)->pMethods->xCheckReservedLock(real(file), result);
}

int ForgetfulVfs::Shim::file_control(sqlite3_file* file, int operation, void* argument) {
  if (is_off(file)) return SQLITE_IOERR;
  return real(file)->pMethods->xFileControl(real(file), operation, argument);
}

int ForgetfulVfs::Shim::sector_size(sqlite3_file*) { return static_cast<int>(kDiskSectorBytes); }

int ForgetfulVfs::Shim::device_characteristics(sqlite3_file* file) {
  return opened(file).vfs.survival_ == Survival::torn ? 0 : SQLITE_IOCAP_POWERSAFE_OVERWRITE;
}

int ForgetfulVfs::Shim::shm_map(sqlite3_file* file, int page, int page_size, int extend, void volatile** memory) {
  if (is_off(file)) return SQLITE_IOERR;
  return real(file)->pMethods->xShmMap(real(file), page, page_size, extend, memory);
}

int ForgetfulVfs::Shim::shm_lock(sqlite3_file* file, int offset, int count, int flags) {
  if (is_off(file) && (flags & SQLITE_SHM_UNLOCK) == 0) return SQLITE_IOERR;
  return real(file)->pMethods->xShmLock(real(file), offset, count, flags);
}

void ForgetfulVfs::Shim::shm_barrier(sqlite3_file* file) {
  real(file)->pMethods->xShmBarrier(real(file));
  ForgetfulVfs& our = opened(file).vfs;
  const std::scoped_lock lock{our.mutex_};
  if (!our.has_failed_ && our.count_barriers_) our.count_call("barrier", opened(file).path);
}

int ForgetfulVfs::Shim::shm_unmap(sqlite3_file* file, int remove) {
  return real(file)->pMethods->xShmUnmap(real(file), remove);
}

// Version 2: no memory-mapped reads, which would pass us by.
const sqlite3_io_methods ForgetfulVfs::Shim::kMethods = {
    2,
    close,
    read,
    write,
    truncate,
    sync,
    file_size,
    lock,
    unlock,
    check_reserved_lock,
    file_control,
    sector_size,
    device_characteristics,
    shm_map,
    shm_lock,
    shm_barrier,
    shm_unmap,
    nullptr,
    nullptr,
};

ForgetfulVfs::ForgetfulVfs() : real_{sqlite3_vfs_find(nullptr)}, vfs_{std::make_unique<sqlite3_vfs>(*real_)} {
  vfs_->iVersion = 2;
  vfs_->szOsFile = static_cast<int>(sizeof(Shim::File)) + real_->szOsFile;
  vfs_->pNext = nullptr;
  vfs_->zName = "forgetful";
  vfs_->pAppData = this;
  vfs_->xOpen = Shim::open;
  vfs_->xDelete = Shim::remove;
  vfs_->xAccess = Shim::access;
  sqlite3_vfs_register(vfs_.get(), 1);
}

ForgetfulVfs::~ForgetfulVfs() { sqlite3_vfs_unregister(vfs_.get()); }

void ForgetfulVfs::begin(Survival survival, std::uint64_t last_call, bool count_barriers) {
  const std::scoped_lock lock{mutex_};
  survival_ = survival;
  calls_ = 0;
  last_call_ = last_call;
  count_barriers_ = count_barriers;
  refused_writes_ = 0;
  has_failed_ = false;
  failed_call_.clear();
}

bool ForgetfulVfs::has_failed() const {
  const std::scoped_lock lock{mutex_};
  return has_failed_;
}

std::string ForgetfulVfs::failed_call() const {
  const std::scoped_lock lock{mutex_};
  return failed_call_;
}

void ForgetfulVfs::refuse_writes(unsigned count) {
  const std::scoped_lock lock{mutex_};
  refused_writes_ = count;
}

void ForgetfulVfs::hold_database_writes() {
  const std::scoped_lock lock{mutex_};
  holds_database_writes_ = true;
}

bool ForgetfulVfs::await_held_write(std::chrono::seconds limit) const {
  std::unique_lock lock{mutex_};
  return hold_changed_.wait_for(lock, limit, [this] { return holds_one_; });
}

void ForgetfulVfs::let_go() {
  const std::scoped_lock lock{mutex_};
  holds_database_writes_ = false;
  hold_changed_.notify_all();
}

void ForgetfulVfs::stand_still_if_held(const OpenFile& file) {
  std::unique_lock lock{mutex_};
  if (!holds_database_writes_ || !file.disk_file || kind_of(file.path) != "database") return;
  holds_one_ = true;
  hold_changed_.notify_all();
  hold_changed_.wait(lock, [this] { return !holds_database_writes_; });
  holds_one_ = false;
}

bool ForgetfulVfs::count_call(const char* name, std::string_view path) {
  has_failed_ = ++calls_ == last_call_;
  if (has_failed_) failed_call_ = std::string{name} + " of the " + std::string{kind_of(path)};
  return has_failed_;
}

void ForgetfulVfs::lose_power(std::mt19937& random) {
  const std::scoped_lock lock{mutex_};
  disk_.lose_power(survival_, random);
}

}  // namespace server
