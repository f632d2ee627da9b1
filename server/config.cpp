// Reads and checks the configuration.
#include "server/config.hpp"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <toml++/toml.h>
#include <array>
#include <cmath>
#include <set>
#include <stdexcept>

#include "server/endpoint.hpp"

namespace server {
namespace {

// Takes values out of a parsed file; what is left at the end is a key that nobody knows.
class ConfigFile {
 public:
  explicit ConfigFile(const std::filesystem::path& path) : path_{path.string()} {
    try {
      table_ = toml::parse_file(path_);
    } catch (const toml::parse_error& error) {
      throw std::invalid_argument{
          fmt::format("{}:{}: {}", path_, error.source().begin.line, std::string{error.description()})};
    }
  }

  // True when the key is there. T is bool, std::string, std::int64_t or double (which also takes integers).
  template <class T>
  bool take(const char* section, const char* key, T& into) {
    known_.insert(fmt::format("{}.{}", section, key));
    const toml::node* node = find(section, key);
    if (node == nullptr) return false;
    const auto value = exact<T>(*node);
    if (!value) fail(*node, section, key, fmt::format("must be {}", type_name(into)));
    into = *value;
    return true;
  }

  void take_number(const char* section, const char* key, double minimum, double maximum, double& into) {
    if (!take(section, key, into)) return;
    if (std::isfinite(into) && into >= minimum && into <= maximum) return;
    fail(*find(section, key), section, key, fmt::format("= {} is outside {} to {}", into, minimum, maximum));
  }

  void take_count(const char* section, const char* key, std::int64_t minimum, std::int64_t maximum,
                  std::uint32_t& into) {
    std::int64_t value = into;
    if (take(section, key, value) && (value < minimum || value > maximum)) {
      fail(*find(section, key), section, key, fmt::format("= {} is outside {} to {}", value, minimum, maximum));
    }
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
        throw std::invalid_argument{
            fmt::format("{}:{}: '{}' stands outside a section", path_, content.source().begin.line, section_name)};
      }
      for (const auto& [key, value] : *content.as_table()) {
        const std::string name = fmt::format("{}.{}", section_name, std::string{key.str()});
        if (known_.contains(name)) continue;
        throw std::invalid_argument{fmt::format("{}:{}: unknown option '{}'; known are {}", path_,
                                                value.source().begin.line, name, fmt::join(known_, ", "))};
      }
    }
  }

  [[noreturn]] void fail(const toml::node& node, const char* section, const char* key, const std::string& why) const {
    throw std::invalid_argument{fmt::format("{}:{}: {}.{} {}", path_, node.source().begin.line, section, key, why)};
  }

  const toml::node* find(const char* section, const char* key) const { return table_[section][key].node(); }

 private:
  template <class T>
  static std::optional<T> exact(const toml::node& node) {
    if constexpr (std::is_same_v<T, double>) {
      return node.is_number() ? node.value<double>() : std::nullopt;
    } else {
      return node.value_exact<T>();
    }
  }

  static const char* type_name(bool) { return "true or false"; }
  static const char* type_name(const std::string&) { return "a text in quotes"; }
  static const char* type_name(std::int64_t) { return "a whole number"; }
  static const char* type_name(double) { return "a number"; }

  std::string path_;
  toml::table table_;
  std::set<std::string> known_;
};

void read(ConfigFile& file, Config& config) {
  std::string data_dir;
  if (file.take("data", "dir", data_dir)) config.data_dir = data_dir;
  if (file.take("http", "listen", config.http)) config.http_or_any_port = false;
  file.take_texts("http", "hosts", config.http_hosts);
  if (file.take("robots", "listen", config.robots)) config.robots_or_any_port = false;
  file.take("robots", "enrol_on_loopback", config.enrol_on_loopback);
  file.take_count("robots", "link_timeout_ms", 200, 5000, config.link.link_timeout_ms);
  file.take_count("robots", "heartbeat_interval_ms", 50, 2500, config.link.heartbeat_interval_ms);
  file.take_count("robots", "samples_per_frame", 0, protocol::kMaxSamplesPerFrame, config.link.samples_per_frame);
  file.take_number("limits", "setpoint_min_m", -100, 100, config.limits.setpoint_min_m);
  file.take_number("limits", "setpoint_max_m", -100, 100, config.limits.setpoint_max_m);
  file.take_number("limits", "duty_min", -1, 0, config.limits.duty_min);
  file.take_number("limits", "duty_max", 0, 1, config.limits.duty_max);
  file.take_number("limits", "disturbance_max_m", 0, 100, config.limits.disturbance_max_m);
  RecordingConfig& recording = config.recording;
  file.take_count("recording", "retention_days", 0, 36'500, recording.retention_days);
  file.take_count("recording", "max_database_mb", 0, 100'000'000, recording.max_database_mb);
  file.take_count("recording", "low_space_mb", 0, 100'000'000, recording.low_space_mb);
  file.take_count("recording", "critical_space_mb", 0, 100'000'000, recording.critical_space_mb);
  std::string backup_dir;
  if (file.take("recording", "backup_dir", backup_dir)) recording.backup_dir = backup_dir;
  if (file.take("log", "level", config.log_level)) {
    constexpr std::array kLevels{"trace", "debug", "info", "warn", "error"};
    if (std::ranges::find(kLevels, config.log_level) == kLevels.end()) {
      file.fail(*file.find("log", "level"), "log", "level",
                fmt::format("= '{}' must be one of {}", config.log_level, fmt::join(kLevels, ", ")));
    }
  }
  file.refuse_unknown_keys();
}

void check(const Config& config) {
  parse_endpoint(config.http);
  parse_endpoint(config.robots);
  if (config.limits.setpoint_min_m >= config.limits.setpoint_max_m) {
    throw std::invalid_argument{fmt::format("limits.setpoint_min_m = {} must be below limits.setpoint_max_m = {}",
                                            config.limits.setpoint_min_m, config.limits.setpoint_max_m)};
  }
  if (config.recording.critical_space_mb > config.recording.low_space_mb) {
    throw std::invalid_argument{
        fmt::format("recording.critical_space_mb = {} must be at most recording.low_space_mb = {}",
                    config.recording.critical_space_mb, config.recording.low_space_mb)};
  }
  if (config.link.heartbeat_interval_ms * 2 > config.link.link_timeout_ms) {
    throw std::invalid_argument{
        fmt::format("robots.heartbeat_interval_ms = {} must be at most half of robots.link_timeout_ms = {}",
                    config.link.heartbeat_interval_ms, config.link.link_timeout_ms)};
  }
}

}  // namespace

Config load_config(const ConfigFlags& flags) {
  Config config;
  if (flags.file) {
    if (!std::filesystem::is_regular_file(*flags.file)) {
      throw std::invalid_argument{fmt::format("config file '{}' does not exist", flags.file->string())};
    }
    ConfigFile file{*flags.file};
    read(file, config);
  }
  if (flags.data_dir) config.data_dir = *flags.data_dir;
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

}  // namespace server
