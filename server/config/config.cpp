// Reads and checks the configuration.
#include "server/config/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <toml++/toml.h>
#include <algorithm>
#include <array>
#include <cstdlib>
#include <map>
#include <set>
#include <utility>

#include "base/fields.hpp"
#include "base/invalid_argument.hpp"
#include "base/toml_text.hpp"
#include "base/toml_value.hpp"
#include "base/whole_file.hpp"
#include "server/config/endpoint.hpp"
#include "server/runtime/private_file.hpp"

namespace server::config {
namespace {

// "~/lab": of the user who runs this, as a shell has it.
std::filesystem::path with_home(const std::string& path) {
  const bool is_home = path == "~" || path.starts_with("~/");
  const char* home = std::getenv("HOME");
  if (!is_home || home == nullptr || *home == '\0') return path;
  return path == "~" ? std::filesystem::path{home} : std::filesystem::path{home} / path.substr(2);
}

// A station of an older version took "~/lab" for a folder named "~" here, and has its recordings in it.
std::filesystem::path data_folder_of(const std::string& path) {
  const std::filesystem::path folder = with_home(path), older = path;
  std::error_code ignored;
  const bool is_left = folder != older && std::filesystem::exists(older / "station.sqlite", ignored) &&
                       !std::filesystem::exists(folder / "station.sqlite", ignored);
  if (is_left) {
    base::throw_invalid("data.dir = '", path, "' is ", folder.string(), " now, and the recordings are in ",
                        std::filesystem::absolute(older).string(), ": move that folder there, or name it as it is");
  }
  return folder;
}

// Takes values out of a parsed file; what is left at the end is a key that nobody knows.
class ConfigFile {
 public:
  ConfigFile(const std::string& text, std::string name) : path_{std::move(name)} {
    table_ = base::parse_toml(text, path_);
  }

  // True when the key is there. T is bool, std::string, std::int64_t or double (which also takes integers).
  template <class T>
  bool take(const char* section, const char* key, T& into) {
    known_.insert(fmt::format("{}.{}", section, key));
    const toml::node* node = find(section, key);
    if (node == nullptr) return false;
    const auto value = base::exact<T>(*node);
    if (!value) fail(*node, section, key, fmt::format("must be {}", type_name(into)));
    into = *value;
    return true;
  }

  void take_number(const char* section, const char* key, base::Range range, double& into) {
    if (take(section, key, into)) check_range(section, key, range, into);
  }

  void take_count(const char* section, const char* key, base::Range range, std::uint32_t& into) {
    std::int64_t value = into;
    if (take(section, key, value)) check_range(section, key, range, value);
    into = static_cast<std::uint32_t>(value);
  }

  void take_texts(const char* section, const char* key, std::vector<std::string>& into) {
    known_.insert(fmt::format("{}.{}", section, key));
    const toml::node* node = find(section, key);
    if (node == nullptr) return;
    if (!node->is_array()) fail(*node, section, key, "must be an array of texts");
    for (const toml::node& element : *node->as_array()) {
      const auto value = element.value<std::string>();
      if (!value) fail(element, section, key, "must be an array of texts");
      into.push_back(*value);
    }
  }

  void refuse_unknown_keys() const {
    for (const auto& [section, content] : table_) {
      const std::string section_name{section.str()};
      if (!content.is_table()) {
        base::throw_invalid(path_, ":", content.source().begin.line, ": '", section_name, "' stands outside a section");
      }
      refuse_unknown_keys(section_name, *content.as_table());
    }
  }

  // Names of the tables in a section, as [section.name] makes them.
  std::vector<std::string> tables_in(const char* section) {
    std::vector<std::string> names;
    const toml::table* content = table_[section].as_table();
    if (content == nullptr) return names;
    for (const auto& [key, value] : *content) {
      if (!value.is_table()) continue;
      names.emplace_back(key.str());
      known_tables_.insert(fmt::format("{}.{}", section, key.str()));
    }
    return names;
  }

  [[noreturn]] void fail(const toml::node& node, const char* section, const char* key, const std::string& why) const {
    base::throw_invalid(path_, ":", node.source().begin.line, ": ", section, ".", key, " ", why);
  }

  // `section` may be a table within a section: "limits.water".
  const toml::node* find(const std::string& section, const char* key) const {
    const auto dot = section.find('.');
    if (dot == std::string::npos) return table_[section][key].node();
    return table_[section.substr(0, dot)][section.substr(dot + 1)][key].node();
  }

 private:
  template <class Number>
  void check_range(const char* section, const char* key, base::Range range, Number value) const {
    if (range.holds(static_cast<double>(value))) return;
    fail(*find(section, key), section, key,
         fmt::format("= {} is outside {} to {}", value, static_cast<Number>(range.minimum),
                     static_cast<Number>(range.maximum)));
  }

  void refuse_unknown_keys(const std::string& section, const toml::table& content) const {
    for (const auto& [key, value] : content) {
      const std::string name = fmt::format("{}.{}", section, std::string{key.str()});
      if (value.is_table() && known_tables_.contains(name)) {
        refuse_unknown_keys(name, *value.as_table());
      } else if (!known_.contains(name)) {
        base::throw_invalid(path_, ":", value.source().begin.line, ": unknown option '", name, "'; known are ",
                            fmt::format("{}", fmt::join(known_, ", ")));
      }
    }
  }

  static const char* type_name(bool) { return "true or false"; }
  static const char* type_name(const std::string&) { return "a text in quotes"; }
  static const char* type_name(std::int64_t) { return "a whole number"; }
  static const char* type_name(double) { return "a number"; }

  std::string path_;
  toml::table table_;
  std::set<std::string> known_, known_tables_;
};

constexpr std::array kTlsModes{TlsMode::automatic, TlsMode::on, TlsMode::off};

void read_tls(ConfigFile& file, TlsConfig& tls) {
  std::string mode = text(tls.mode), certificate, key;
  file.take("tls", "mode", mode);
  const auto found = std::ranges::find(kTlsModes, mode, [](TlsMode known) { return std::string{text(known)}; });
  if (found == kTlsModes.end()) {
    file.fail(*file.find("tls", "mode"), "tls", "mode", fmt::format("= '{}' must be one of auto, on, off", mode));
  }
  tls.mode = *found;
  if (file.take("tls", "certificate", certificate)) tls.certificate = with_home(certificate);
  if (file.take("tls", "key", key)) tls.key = with_home(key);
  file.take("tls", "insecure", tls.insecure);
}

void read_limits(ConfigFile& file, const std::string& section, CommandLimits& limits) {
  const char* name = section.c_str();
  file.take_number(name, "setpoint_min_m", {-100, 100}, limits.setpoint_min_m);
  file.take_number(name, "setpoint_max_m", {-100, 100}, limits.setpoint_max_m);
  file.take_number(name, "setpoint_step_m", {0, 200}, limits.setpoint_step_m);
  file.take_number(name, "duty_min", {-1, 0}, limits.duty_min);
  file.take_number(name, "duty_max", {0, 1}, limits.duty_max);
  file.take_number(name, "power_duty", {0, 1}, limits.power_duty);
  file.take_number(name, "power_s", {0, 3600}, limits.power_s);
  file.take_number(name, "disturbance_max_m", {0, 100}, limits.disturbance_max_m);
  if (limits.setpoint_min_m < limits.setpoint_max_m) return;
  base::throw_invalid(fmt::format("{0}.setpoint_min_m = {1} must be below {0}.setpoint_max_m = {2}", section,
                                  limits.setpoint_min_m, limits.setpoint_max_m));
}

std::string name_of_fluid(ConfigFile& file, const char* section, const std::string& key) {
  std::string name = fluid_name(key);
  if (!name.empty()) return name;
  file.fail(*file.find(section, key.c_str()), section, key.c_str(),
            "must have a fluid's name of 1 to 40 bytes without control characters");
}

// Each [limits.NAME] and [fluids.NAME] lists a fluid.
void read_envelope(ConfigFile& file, Envelope& envelope) {
  CommandLimits anywhere;
  read_limits(file, "limits", anywhere);
  std::map<std::string, CommandLimits> of_fluid;
  for (const std::string& key : file.tables_in("limits")) {
    CommandLimits own = anywhere;  // what it does not say
    read_limits(file, "limits." + key, own);
    if (of_fluid.emplace(name_of_fluid(file, "limits", key), own).second) continue;
    file.fail(*file.find("limits", key.c_str()), "limits", key.c_str(), "names a fluid that another section has named");
  }
  for (const std::string& key : file.tables_in("fluids"))
    of_fluid.emplace(name_of_fluid(file, "fluids", key), anywhere);
  envelope = Envelope{anywhere, std::move(of_fluid)};
}

void read_places(ConfigFile& file, const char* section, PortPlaces& places) {
  file.take_count(section, "max_connections", {16, 32'768}, places.connections);
  file.take_count(section, "max_connections_per_address", {1, 32'768}, places.of_address);
}

void read(ConfigFile& file, Config& config) {
  std::string data_dir;
  if (file.take("data", "dir", data_dir)) config.data_dir = data_folder_of(data_dir);
  file.take("data", "any_file_system", config.any_file_system);
  if (file.take("http", "listen", config.http)) config.http_or_any_port = false;
  file.take_texts("http", "hosts", config.http_hosts);
  read_places(file, "http", config.http_places);
  if (file.take("robots", "listen", config.robots)) config.robots_or_any_port = false;
  file.take("robots", "enrol_on_loopback", config.enrolment.allowed);
  file.take_count("robots", "max_enrolled_on_loopback", {0, 100'000}, config.enrolment.most_robots);
  file.take_count("robots", "enrolments_per_minute", {1, 100'000}, config.enrolment.most_a_minute);
  read_places(file, "robots", config.robot_places);
  file.take_count("robots", "link_timeout_ms", {200, 5000}, config.link.link_timeout_ms);
  file.take_count("robots", "heartbeat_interval_ms", {50, 2500}, config.link.heartbeat_interval_ms);
  file.take_count("robots", "samples_per_frame", {0, protocol::kMaxSamplesPerFrame}, config.link.samples_per_frame);
  read_envelope(file, config.envelope);
  RecordingConfig& recording = config.recording;
  file.take_count("recording", "retention_days", {0, 36'500}, recording.retention_days);
  file.take_count("recording", "event_retention_days", {0, 36'500}, recording.event_retention_days);
  file.take_count("recording", "give_up_after_days", {0, 36'500}, recording.give_up_after_days);
  file.take_count("recording", "max_database_mb", {0, 100'000'000}, recording.max_database_mb);
  file.take_count("recording", "low_space_mb", {0, 100'000'000}, recording.low_space_mb);
  file.take_count("recording", "critical_space_mb", {0, 100'000'000}, recording.critical_space_mb);
  std::string backup_dir;
  if (file.take("recording", "backup_dir", backup_dir)) recording.backup_dir = with_home(backup_dir);
  read_tls(file, config.tls);
  file.take("experiments", "allow_unattended", config.experiments.allow_unattended);
  file.take_count("experiments", "back_within_s", {1, 60}, config.experiments.back_within_s);
  file.take("foxglove", "enabled", config.foxglove);
  file.take("station", "real_time", config.real_time);
  if (file.take("log", "level", config.log_level)) {
    constexpr std::array kLevels{"trace", "debug", "info", "warn", "error"};
    if (std::ranges::find(kLevels, config.log_level) == kLevels.end()) {
      file.fail(*file.find("log", "level"), "log", "level",
                fmt::format("= '{}' must be one of {}", config.log_level, fmt::join(kLevels, ", ")));
    }
  }
  if (file.take("log", "format", config.log_format) && config.log_format != "text" && config.log_format != "json") {
    file.fail(*file.find("log", "format"), "log", "format",
              fmt::format("= '{}' must be text or json", config.log_format));
  }
  file.refuse_unknown_keys();
}

// SAFETY: anybody on the network path could read the token and drive the robots.
void check_tls(const Config& config) {
  const TlsConfig& tls = config.tls;
  if (tls.certificate.empty() != tls.key.empty()) {
    base::throw_invalid("tls.certificate and tls.key belong together: give both, or neither");
  }
  if (tls.mode == TlsMode::on && tls.insecure) {
    base::throw_invalid("tls.mode = 'on' and tls.insecure = true contradict each other: remove one of them");
  }
  for (const auto& [option, listen] : {std::pair{"http.listen", config.http}, {"robots.listen", config.robots}}) {
    if (!config.is_exposed(listen) || tls.insecure) continue;
    base::throw_invalid(option, " = '", listen,
                        "' can be reached by other machines, and tls.mode is 'off': set it to 'auto' and make a "
                        "certificate with `rheonaut certificate`, or accept with tls.insecure = true that everyone on "
                        "the way can read and change what is sent");
  }
}

void check(const Config& config) {
  parse_endpoint(config.http);
  parse_endpoint(config.robots);
  check_tls(config);
  if (config.recording.critical_space_mb > config.recording.low_space_mb) {
    base::throw_invalid("recording.critical_space_mb = ", config.recording.critical_space_mb,
                        " must be at most recording.low_space_mb = ", config.recording.low_space_mb);
  }
  if (config.link.heartbeat_interval_ms * 2 > config.link.link_timeout_ms) {
    base::throw_invalid("robots.heartbeat_interval_ms = ", config.link.heartbeat_interval_ms,
                        " must be at most half of robots.link_timeout_ms = ", config.link.link_timeout_ms);
  }
}

}  // namespace

const char* text(TlsMode mode) {
  switch (mode) {
    case TlsMode::on: return "on";
    case TlsMode::off: return "off";
    default: return "auto";
  }
}

std::filesystem::path Config::tls_certificate() const {
  return tls.certificate.empty() ? data_dir / "tls" / "station.crt" : tls.certificate;
}

std::filesystem::path Config::tls_key() const { return tls.key.empty() ? data_dir / "tls" / "station.key" : tls.key; }

bool Config::speaks_tls(const std::string& listen) const {
  if (tls.mode != TlsMode::automatic) return tls.mode == TlsMode::on;
  return !tls.insecure && !parse_endpoint(listen).address().is_loopback();
}

bool Config::is_exposed(const std::string& listen) const {
  return !speaks_tls(listen) && !parse_endpoint(listen).address().is_loopback();
}

Config parse_config(const std::string& text, const std::string& name) {
  Config config;
  ConfigFile file{text, name};
  read(file, config);
  check(config);
  return config;
}

Config load_config(const ConfigFlags& flags) {
  constexpr std::size_t kMaxConfigBytes = 1 << 20;
  Config config;
  if (flags.file) {
    std::error_code error;
    if (!std::filesystem::is_regular_file(*flags.file, error) && error != std::errc::permission_denied) {
      base::throw_invalid("config file '", flags.file->string(), "' does not exist");
    }
    const base::WholeFile whole = base::read_whole(*flags.file, kMaxConfigBytes);
    if (whole.error != 0)
      base::throw_invalid("cannot read the config file: ", runtime::denial(*flags.file, whole.error));
    if (!whole.problem.empty()) base::throw_invalid("config file '", flags.file->string(), "' ", whole.problem);
    ConfigFile file{whole.text, flags.file->string()};
    read(file, config);
  }
  if (flags.data_dir) config.data_dir = *flags.data_dir;
  if (flags.any_file_system) config.any_file_system = true;
  if (flags.http) {
    config.http = *flags.http;
    config.http_or_any_port = false;
  }
  if (flags.robots) {
    config.robots = *flags.robots;
    config.robots_or_any_port = false;
  }
  check(config);
  return config;
}

}  // namespace server::config
