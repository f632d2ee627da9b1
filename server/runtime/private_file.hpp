// Files that hold secrets: written completely or not at all, and readable by their owner only; and who may have written
// what is read.
//
// SAFETY: a token or session that another user of the machine has put there would let that user drive the robots.
// Trusted are this user and root; root trusts the service's user "rheonaut", too.
#pragma once

#include <sys/stat.h>

#include <filesystem>
#include <optional>
#include <string>

namespace server::runtime {

// The whole file or nothing appears under its name, readable by its owner only from the first moment; what was there
// before is replaced. Throws std::runtime_error that names the file.
void write_private(const std::filesystem::path& file, const std::string& content);

// The file's content; none when there is no such file. A file that others may read is protected first, with a warning.
// Throws std::runtime_error that names it, with what to type, when it is a link or no file, belongs to somebody who is
// not trusted, may not be read, may be written by others, or is longer than 64 KiB.
std::optional<std::string> read_private(const std::filesystem::path& file);

// Throws std::runtime_error that names the folder, with what to type, when it belongs to somebody who is not trusted or
// may be written by all users; warns when its group may write.
void require_own_folder(const std::filesystem::path& folder);

// Why a call on the path failed with this errno. Where it is a matter of rights: whose the path is, or the folder that
// keeps this program from it, and what to do.
std::string denial(const std::filesystem::path& path, int error);

// The denial() of a path that this program may not use so: R_OK, W_OK or X_OK of unistd.h, or several. None for a path
// that it may use so, and for one that is not there.
std::optional<std::string> denied(const std::filesystem::path& path, int mode);

// Whether the path is there. Throws std::runtime_error with the denial() where a folder on the way keeps this program
// from looking.
bool is_there(const std::filesystem::path& path);

}  // namespace server::runtime
