// Chooses what survives, sector by sector.
#include "tests/server/recording/forgetful_disk.hpp"

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <set>
#include <stdexcept>

namespace server {
namespace {

void put(std::string& content, std::uint64_t offset, std::string_view bytes) {
  if (content.size() < offset + bytes.size()) content.resize(offset + bytes.size());
  content.replace(offset, bytes.size(), bytes);
}

std::string read_whole(const std::string& path) {
  std::ifstream file{path, std::ios::binary};
  return {std::istreambuf_iterator<char>{file}, {}};
}

void write_whole(const std::string& path, const std::string& content) {
  std::ofstream file{path, std::ios::binary | std::ios::trunc};
  file.write(content.data(), static_cast<std::streamsize>(content.size()));
  if (!file.flush()) throw std::runtime_error{"cannot write " + path};
}

// The part of a write that lies in one sector, while the power fails.
void tear(std::string& content, std::uint64_t offset, std::string_view bytes, std::mt19937& random) {
  if (random() % 2 == 0) {
    put(content, offset, bytes.substr(0, random() % (bytes.size() + 1)));
    return;
  }
  const std::uint64_t first = offset - offset % kDiskSectorBytes;
  const std::uint64_t next = std::min(first + kDiskSectorBytes, std::max(content.size(), offset + bytes.size()));
  std::string noise(next - first, '\0');
  for (char& byte : noise) byte = static_cast<char>(random());
  put(content, first, noise);
}

}  // namespace

const char* text(Survival value) {
  switch (value) {
    case Survival::nothing: return "nothing";
    case Survival::sectors: return "sectors";
    case Survival::torn: return "torn";
  }
  return "?";
}

void DiskFile::sync() {
  for (const Change& change : changes_) {
    if (change.truncates) {
      durable_.resize(change.offset);
    } else {
      put(durable_, change.offset, change.bytes);
    }
  }
  changes_.clear();
}

// Later changes go over earlier ones, so each sector ends with any of the contents it ever had since the last sync.
std::string DiskFile::after_power_cut(Survival survival, std::mt19937& random) const {
  std::string content = durable_;
  if (survival == Survival::nothing) return content;
  const unsigned kept_percent = random() % 101;
  const auto is_kept = [&] { return random() % 100 < kept_percent; };
  for (const Change& change : changes_) {
    if (change.truncates && is_kept()) content.resize(change.offset);
    std::string_view left = change.bytes;
    for (std::uint64_t at = change.offset; !left.empty();) {
      const std::string_view piece = left.substr(0, kDiskSectorBytes - at % kDiskSectorBytes);
      if (is_kept()) {
        put(content, at, piece);
      } else if (survival == Survival::torn && random() % 4 == 0) {
        tear(content, at, piece, random);
      }
      at += piece.size();
      left.remove_prefix(piece.size());
    }
  }
  return content;
}

std::shared_ptr<DiskFile> ForgetfulDisk::open(const std::string& path) {
  if (const auto known = now_.find(path); known != now_.end()) return known->second;
  if (std::filesystem::exists(path)) {
    return now_[path] = durable_[path] = std::make_shared<DiskFile>(read_whole(path));
  }
  return now_[path] = std::make_shared<DiskFile>();
}

void ForgetfulDisk::sync(const std::string& path, const std::shared_ptr<DiskFile>& file) {
  file->sync();
  const auto found = now_.find(path);
  if (found != now_.end() && found->second == file) durable_[path] = file;  // not when removed while it is open
}

void ForgetfulDisk::lose_power(Survival survival, std::mt19937& random) {
  std::set<std::string> paths;
  for (const Names* names : {&now_, &durable_}) {
    for (const auto& [path, file] : *names) paths.insert(path);
  }
  Names left;
  for (const std::string& path : paths) {
    std::filesystem::remove(path + "-shm");
    const bool name_is_new = survival != Survival::nothing && random() % 2 == 0;
    const Names& names = name_is_new ? now_ : durable_;
    if (const auto found = names.find(path); found != names.end()) {
      left[path] = std::make_shared<DiskFile>(found->second->after_power_cut(survival, random));
      write_whole(path, left[path]->after_power_cut(Survival::nothing, random));
    } else {
      std::filesystem::remove(path);
    }
  }
  now_ = durable_ = std::move(left);
}

}  // namespace server
