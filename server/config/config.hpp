// All settings of the station: one struct, each field with its key in the file, its flag, its default and its unit.
//
// Order of precedence: flag, file, default. deploy/rheonaut.toml documents the file; a test holds it to this struct.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <cstdint>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "server/config/envelope.hpp"
#include "server/config/experiment_rules.hpp"
#include "server/config/link_settings.hpp"

namespace server::config {

// Section [recording]: how long samples and events that no run holds are kept, and how much room there must be. 1 MB is
// 10^6 bytes.
struct RecordingConfig {
  std::uint32_t retention_days = 0;        // recording.retention_days; 0: for ever
  std::uint32_t event_retention_days = 0;  // recording.event_retention_days: the same of events; 0: for ever
  std::uint32_t max_database_mb = 0;       // recording.max_database_mb; 0: no limit
  std::uint32_t low_space_mb = 2048;       // recording.low_space_mb: with less free space people are warned
  std::uint32_t critical_space_mb = 512;   // recording.critical_space_mb: ... nothing new is begun
  std::filesystem::path backup_dir;        // recording.backup_dir; empty: "backups" in the data folder
  // recording.give_up_after_days: after which a run is final whose robot is away with samples of it; 0: never
  std::uint32_t give_up_after_days = 0;
};

// Section [tls]. Beyond this machine's loopback, bytes travel in TLS or, where somebody said so, in plain sight.
enum class TlsMode : std::uint8_t {
  automatic,  // "auto": TLS on every address but loopback
  on,         // on loopback, too
  off,
};

struct TlsConfig {
  TlsMode mode = TlsMode::automatic;  // tls.mode
  std::filesystem::path certificate;  // tls.certificate, PEM with its chain; empty: of `rheonaut certificate`
  std::filesystem::path key;          // tls.key, PEM; empty: as above
  bool insecure = false;              // tls.insecure: plain TCP on an address that other machines reach
};

// How many may be connected to a port at once. From one address of this machine three quarters of all may come.
struct PortPlaces {
  std::uint32_t connections;  // .max_connections
  std::uint32_t of_address;   // .max_connections_per_address, of another machine
};

struct Config {
  std::filesystem::path data_dir = "rheonaut-data";  // data.dir, --data: database, token, endpoints

  std::string http = "127.0.0.1:8080";  // http.listen, --http
  bool http_or_any_port = true;         // only while the default stands: a taken port is replaced by a free one
  std::vector<std::string> http_hosts;  // http.hosts: further names by which pages may address the station
  PortPlaces http_places{256, 64};      // http.max_connections, .max_connections_per_address

  std::string robots = "127.0.0.1:7070";  // robots.listen, --robots
  bool robots_or_any_port = true;         // as above
  LoopbackEnrolment enrolment;            // robots.enrol_on_loopback, .max_enrolled_on_loopback, .enrolments_per_minute
  PortPlaces robot_places{8192, 1024};    // robots.max_connections, .max_connections_per_address
  LinkTimes link;                         // robots.link_timeout_ms, .heartbeat_interval_ms, .samples_per_frame

  // limits.setpoint_min_m, .setpoint_max_m, …; of a fluid: limits.FLUID.setpoint_min_m, …; fluids.FLUID lists one, too
  Envelope envelope{};

  RecordingConfig recording;

  TlsConfig tls;

  bool any_file_system = false;  // data.any_file_system: a new store also where it can be damaged

  ExperimentRules experiments;  // experiments.allow_unattended, .back_within_s

  bool foxglove = false;  // foxglove.enabled: live samples by the Foxglove WebSocket protocol

  bool real_time = true;  // station.real_time: the loop has real-time priority on a busy machine

  std::string log_level = "info";   // log.level: trace, debug, info, warn, error
  std::string log_format = "text";  // log.format: text, or json with one object a line

  std::filesystem::path database() const { return data_dir / "station.sqlite"; }
  std::filesystem::path tls_certificate() const;
  std::filesystem::path tls_key() const;
  // Of `http` or `robots`: whether TLS is spoken there, and whether neither TLS nor loopback protects it.
  bool speaks_tls(const std::string& listen) const;
  bool is_exposed(const std::string& listen) const;
};

// "auto", "on", "off"
const char* text(TlsMode mode);

// What the command line gives; empty fields were not given.
struct ConfigFlags {
  std::optional<std::filesystem::path> file;
  std::optional<std::filesystem::path> data_dir;
  std::optional<std::string> http;
  std::optional<std::string> robots;
  bool any_file_system = false;
};

// Reads the file (if one is given), then applies the flags, then checks every value. Throws std::invalid_argument that
// says file, line, key, value and what to do.
Config load_config(const ConfigFlags& flags);

// The same of a file's text alone; `name` is what errors call it.
Config parse_config(const std::string& text, const std::string& name);

}  // namespace server::config
