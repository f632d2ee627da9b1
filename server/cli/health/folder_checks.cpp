// Modes and owners by stat(); the certificate as the station reads it.
#include "server/cli/health/folder_checks.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>
#include <pwd.h>
#include <sys/stat.h>
#include <unistd.h>

#include <algorithm>
#include <boost/algorithm/string/predicate.hpp>
#include <optional>

#include "server/config/endpoint.hpp"
#include "server/runtime/exceptions.hpp"
#include "server/tls/tls_certificate.hpp"

namespace server::cli {
namespace fs = std::filesystem;

namespace {

constexpr std::int64_t kDayUs = 86'400'000'000;
constexpr mode_t kOfOthers = 077, kWritableByOthers = 022;

std::optional<struct stat> status_of(const fs::path& path) {
  struct stat status{};
  return ::stat(path.c_str(), &status) == 0 ? std::optional{status} : std::nullopt;
}

std::string user_name(uid_t user) {
  const passwd* entry = getpwuid(user);
  return entry == nullptr ? fmt::format("user {}", user) : entry->pw_name;
}

// A person who can read one of these can drive the robots, or pretend to be the station.
std::vector<fs::path> secrets_of(const config::Config& config) {
  std::vector<fs::path> files{config.data_dir / "rheonaut.token", config.database(),
                              config.data_dir / "tls/station.key", config.data_dir / "tls/lab-ca.key"};
  if (!config.tls.key.empty()) files.push_back(config.tls.key);
  for (const char* beside : {"-wal", "-shm"}) files.emplace_back(config.database().string() + beside);
  return files;
}

void judge_secret(const fs::path& file, const struct stat& folder, Findings& findings) {
  const auto status = status_of(file);
  if (!status) return;
  if ((status->st_mode & kOfOthers) != 0) {
    findings.problem(
        "permissions",
        fmt::format("other users may read or change {} (mode {:04o})", file.string(), status->st_mode & 07777),
        fmt::format("chmod 600 '{}'; who may have read it can drive robots: renew it (docs/operations.md)",
                    file.string()));
  }
  if (status->st_uid != folder.st_uid) {
    findings.problem("permissions",
                     fmt::format("{} belongs to {}, the folder to {}: a tool ran here as another user", file.string(),
                                 user_name(status->st_uid), user_name(folder.st_uid)),
                     fmt::format("chown {} '{}'", user_name(folder.st_uid), file.string()));
  }
}

// "*.lab.example" covers one label more: "page.lab.example".
bool names_cover(const tls::TlsCertificate& certificate, const std::string& name) {
  const std::size_t dot = name.find('.');
  const std::string wildcard = dot == std::string::npos ? "" : "*" + name.substr(dot);
  return std::ranges::any_of(certificate.names, [&](const std::string& covered) {
    return boost::iequals(covered, name) || (!wildcard.empty() && boost::iequals(covered, wildcard));
  });
}

void judge_names(const config::Config& config, const tls::TlsCertificate& certificate, Findings& findings) {
  std::vector<std::string> missing;
  for (const std::string& name : config.http_hosts) {
    if (!names_cover(certificate, name)) missing.push_back(name);
  }
  const auto address = config::parse_endpoint(config.http).address();
  const bool is_named = address.is_unspecified() || address.is_loopback();
  if (!is_named && !names_cover(certificate, address.to_string())) missing.push_back(address.to_string());
  if (missing.empty()) return;
  const std::string what = fmt::format("it is for {}, and not for {}: browsers that use that name refuse it",
                                       fmt::join(certificate.names, ", "), fmt::join(missing, ", "));
  const std::string renew =
      fmt::format("rheonaut certificate --data '{}' --name …, with every name", config.data_dir.string());
  if (!address.is_loopback()) return findings.problem("certificate", what, renew);
  findings.note("certificate", what,
                "nothing where a proxy answers to that name with its own certificate; else " + renew);
}

void judge_expiry(const config::Config& config, const tls::TlsCertificate& certificate, std::int64_t now_us,
                  Findings& findings) {
  constexpr std::int64_t kSoonDays = 30;
  const std::int64_t days = (certificate.not_after_us - now_us) / kDayUs;
  const std::string renew = fmt::format("rheonaut certificate --renew --data '{}'", config.data_dir.string());
  if (certificate.not_after_us <= now_us) {
    findings.problem("certificate", "it has expired: browsers and robots refuse the station", renew);
  } else if (certificate.not_before_us > now_us) {
    findings.problem("certificate", "it is not valid yet: the clock is wrong now, or was when it was made",
                     "set the clock, then " + renew);
  } else if (days < kSoonDays) {
    findings.problem("certificate", fmt::format("it expires in {} days", days), renew);
  } else {
    findings.fine("certificate",
                  fmt::format("it is for {} and valid for {} days", fmt::join(certificate.names, ", "), days));
  }
}

}  // namespace

void check_permissions(const config::Config& config, Findings& findings) {
  const auto folder = status_of(config.data_dir);
  if (!folder) return;
  const std::size_t before = findings.problems();
  const std::string name = config.data_dir.string();
  if ((folder->st_mode & kWritableByOthers) != 0) {
    findings.problem("permissions",
                     fmt::format("other users may write into {} (mode {:04o})", name, folder->st_mode & 07777),
                     fmt::format("chmod 700 '{}'", name));
  }
  if (folder->st_uid != geteuid() && geteuid() != 0) {
    findings.note("permissions",
                  fmt::format("{} belongs to {}, you are {}: not everything can be looked at", name,
                              user_name(folder->st_uid), user_name(geteuid())),
                  fmt::format("sudo -u {} rheonaut doctor --data '{}'", user_name(folder->st_uid), name));
  }
  for (const fs::path& file : secrets_of(config)) judge_secret(file, *folder, findings);
  if (findings.problems() > before) return;
  findings.fine("permissions",
                fmt::format("{} belongs to {}; its secrets are for that user only", name, user_name(folder->st_uid)));
}

void check_certificate(const config::Config& config, std::int64_t now_us, Findings& findings) {
  const bool is_needed = config.speaks_tls(config.http) || config.speaks_tls(config.robots);
  for (const std::string& listen : {config.http, config.robots}) {
    if (!config.is_exposed(listen)) continue;
    findings.note("certificate",
                  fmt::format("{} is reached by other machines and speaks plain TCP: anybody there "
                              "can drive the robots",
                              listen),
                  "docs/operations.md, \"Access from other machines\"");
  }
  const fs::path file = config.tls_certificate(), key_file = config.tls_key();
  if (!fs::exists(file)) {
    if (!is_needed) return findings.fine("certificate", "none is needed: no port speaks TLS");
    return findings.problem("certificate", fmt::format("{} is not there, and a port speaks TLS", file.string()),
                            fmt::format("rheonaut certificate --data '{}' --name NAME", config.data_dir.string()));
  }
  Findings of_file;
  try {
    const tls::TlsCertificate certificate = tls::describe(*tls::load_certificate(file));
    if (tls::public_key_pem(*tls::load_key(key_file)) != certificate.public_key_pem) {
      of_file.problem("certificate", fmt::format("{} is not the key of {}", key_file.string(), file.string()),
                      "put the two files of the same certificate there, or make both anew: rheonaut certificate");
    }
    if (config.speaks_tls(config.http)) judge_names(config, certificate, of_file);
    judge_expiry(config, certificate, now_us, of_file);
  } catch (const std::exception& error) {  // the file is named in it
    of_file.problem("certificate", runtime::text_of(error),
                    "put a certificate and its key in PEM there, or make both anew: "
                    "rheonaut certificate");
  }
  if (is_needed) return findings.append(of_file);
  for (const Finding& found : of_file.all()) {
    if (found.grade == Grade::fine) {
      findings.fine(found.topic, found.what);
    } else {
      findings.note(found.topic, found.what + " (no port of this configuration speaks TLS)", found.action);
    }
  }
}

}  // namespace server::cli
