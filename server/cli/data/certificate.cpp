// Makes or renews what is in DATA/tls, and says what to do with it.
#include "server/cli/data/certificate.hpp"

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <fmt/ostream.h>
#include <fmt/ranges.h>
#include <unistd.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <array>
#include <cctype>
#include <ctime>
#include <stdexcept>

#include "server/cli/data/certificate_maker.hpp"
#include "server/cli/terminal/exit_status.hpp"
#include "server/cli/terminal/options.hpp"
#include "server/config/data_folder.hpp"
#include "server/runtime/private_file.hpp"
#include "server/tls/tls_certificate.hpp"

namespace server::cli {
namespace fs = std::filesystem;

namespace {

constexpr std::size_t kMaxNameLength = 253;
constexpr int kMaxDays = 3650;

struct Files {
  explicit Files(const fs::path& data_dir)
      : folder{data_dir / "tls"},
        authority{folder / "lab-ca.crt"},
        authority_key{folder / "lab-ca.key"},
        certificate{folder / "station.crt"},
        key{folder / "station.key"} {}
  fs::path folder, authority, authority_key, certificate, key;
};

void add(std::vector<std::string>& names, const std::string& name) {
  if (std::ranges::find(names, name) == names.end()) names.push_back(name);
}

std::string host_name() {
  std::array<char, 256> name{};
  return gethostname(name.data(), name.size() - 1) == 0 ? name.data() : "";
}

bool is_name(const std::string& name) {
  const auto allowed = [](unsigned char c) { return std::isalnum(c) != 0 || c == '-' || c == '.'; };
  return is_address(name) || (!name.empty() && name.size() <= kMaxNameLength && std::ranges::all_of(name, allowed));
}

// Those that were asked for, or else those of the certificate that is renewed; always those of this machine.
std::vector<std::string> names_of(const Certificate& options, const Files& files) {
  std::vector<std::string> names = options.names;
  if (names.empty() && fs::exists(files.certificate))
    names = tls::describe(*tls::load_certificate(files.certificate)).names;
  for (const std::string& own : {host_name(), std::string{"localhost"}, std::string{"127.0.0.1"}, std::string{"::1"}}) {
    if (is_name(own)) add(names, own);
  }
  return names;
}

// After a crash either nothing or both files of a pair are there; a key without certificate is used.
bool make_authority_unless_there(const Files& files) {
  if (fs::exists(files.authority)) return false;
  const base::Openssl<EVP_PKEY> key = fs::exists(files.authority_key) ? tls::load_key(files.authority_key) : make_key();
  runtime::write_private(files.authority_key, key_pem(*key));
  runtime::write_private(files.authority, certificate_pem(*make_authority(*key)));
  return true;
}

void check(const Certificate& options, const Files& files) {
  for (const std::string& name : options.names) {
    if (!is_name(name)) throw UsageError{fmt::format("'{}' is neither a host name nor an address", name)};
  }
  if (fs::exists(files.certificate) && !options.renew) {
    throw std::runtime_error{
        fmt::format("'{}' is there already; --renew makes a new one with the same key, so that pins stay valid",
                    files.certificate.string())};
  }
  if (options.new_key && !options.renew) throw UsageError{"--new-key goes with --renew"};
}

nlohmann::ordered_json json_of(const Files& files, const tls::TlsCertificate& made, bool is_authority_new) {
  return {{"authority", fs::absolute(files.authority).string()},
          {"authority_is_new", is_authority_new},
          {"certificate", fs::absolute(files.certificate).string()},
          {"names", made.names},
          {"not_after_us", made.not_after_us},
          {"pin", made.pin},
          {"public_key_pem", made.public_key_pem}};
}

void print_what_to_do(const Files& files, const tls::TlsCertificate& made, bool is_authority_new, std::ostream& out) {
  if (is_authority_new) fmt::print(out, "made     {}, the authority of this lab\n", files.authority.string());
  fmt::print(out, "made     {}\n", files.certificate.string());
  fmt::print(out, "names    {}\n", fmt::join(made.names, ", "));
  fmt::print(out, "until    {:%Y-%m-%d}\n", fmt::gmtime(static_cast<std::time_t>(made.not_after_us / 1'000'000)));
  fmt::print(out, "pin      {}\n", made.pin);
  fmt::print(out, "\nBrowsers: import {} as an authority for websites.\n", fs::absolute(files.authority).string());
  fmt::print(out, "rheonaut-sim: --tls-pin {}\n", made.pin);
  fmt::print(out, "Robots pin this key (station_key_pem in secrets.hpp):\n{}", made.public_key_pem);
  fmt::print(out,
             "A station that runs takes the certificate within 5 s; one that starts speaks TLS on every address\n"
             "but loopback. {} stays here: who has it can pass for this station.\n",
             files.authority_key.string());
}

}  // namespace

void add_options(CLI::App& command, Certificate& options) {
  command.add_option("--data", options.data_dir, "Folder of the station (default: rheonaut-data)")->check(named());
  command
      .add_option("--name", options.names,
                  "Host names and IP addresses by which it is reached, beside this machine's name and loopback")
      ->check(named());
  command.add_flag("--renew", options.renew, "Make a new one though there is one, with the same key and names");
  command.add_flag("--new-key", options.new_key, "... with another key: everyone who pinned the old one must be told");
  command.add_option("--days", options.days, "How long it is good for (default: 825)")->check(whole(1, kMaxDays));
  add_json_flag(command, options.form);
  command.footer("Example: rheonaut certificate --data ~/lab --name lab-pc.local --name 192.168.1.20");
}

int run(const Certificate& options, std::ostream& out) {
  const Files files{options.data_dir};
  check(options, files);
  config::make_data_folder(options.data_dir);
  config::make_data_folder(files.folder);
  const std::vector<std::string> names = names_of(options, files);
  const bool is_authority_new = make_authority_unless_there(files);
  const bool keeps_key = fs::exists(files.key) && !options.new_key;
  const base::Openssl<EVP_PKEY> key = keeps_key ? tls::load_key(files.key) : make_key();
  const base::Openssl<X509> authority = tls::load_certificate(files.authority);
  const base::Openssl<EVP_PKEY> authority_key = tls::load_key(files.authority_key);
  const base::Openssl<X509> made = make_certificate(*key, names, options.days, *authority, *authority_key);
  if (!keeps_key) runtime::write_private(files.key, key_pem(*key));
  runtime::write_private(files.certificate, certificate_pem(*made));
  if (options.form.is_json) {
    write_json(out, json_of(files, tls::describe(*made), is_authority_new));
  } else {
    print_what_to_do(files, tls::describe(*made), is_authority_new, out);
  }
  return 0;
}

}  // namespace server::cli
