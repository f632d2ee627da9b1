// Reads where the station is, and makes a trust of the flags.
#include "sim_robot/cli/station_options.hpp"

#include <CLI/CLI.hpp>
#include <cerrno>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <stdexcept>

#include "base/tls/public_key.hpp"
#include "base/whole_file.hpp"

namespace sim_robot {
namespace {

// What the station says of itself while it runs (server/config/data_folder.hpp).
nlohmann::json announcement_in(const std::string& data_dir) {
  constexpr std::size_t kMaxBytes = 64 * 1024;
  const base::WholeFile whole = base::read_whole(data_dir + "/endpoints.json", kMaxBytes);
  if (!whole.problem.empty() && whole.error != ENOENT && whole.error != ENOTDIR) {
    throw std::runtime_error(data_dir + "/endpoints.json " + whole.problem);
  }
  if (!whole.problem.empty()) {
    throw std::runtime_error("no station runs in '" + data_dir +
                             "': there is no endpoints.json; rheonaut serve --data " + data_dir + " starts one");
  }
  auto content = nlohmann::json::parse(whole.text, nullptr, false);
  if (content.is_object() && content.contains("robots") && content["robots"].is_string()) return content;
  throw std::runtime_error("'" + data_dir + "/endpoints.json' does not say where the station is");
}

// A station that listens on every address is dialled on loopback.
StationAddress announced(const nlohmann::json& announcement) {
  StationAddress station = parse_station_address(announcement["robots"].get<std::string>(), "endpoints.json");
  if (station.host == "0.0.0.0") station.host = "127.0.0.1";
  if (station.host == "::") station.host = "::1";
  return station;
}

// The station's certificate lies on this machine: its key is the one to trust.
std::string pin_of_certificate(const std::string& file) {
  constexpr std::size_t kMaxBytes = 1 << 20;
  const base::WholeFile whole = base::read_whole(std::filesystem::path{file}, kMaxBytes);
  if (!whole.problem.empty()) throw std::runtime_error("the station's certificate '" + file + "' " + whole.problem);
  const base::Openssl<BIO> in{BIO_new_mem_buf(whole.text.data(), static_cast<int>(whole.text.size()))};
  const base::Openssl<X509> certificate{in ? PEM_read_bio_X509(in.get(), nullptr, nullptr, nullptr) : nullptr};
  const EVP_PKEY* key = certificate ? X509_get0_pubkey(certificate.get()) : nullptr;
  if (key == nullptr) throw std::runtime_error("the station's certificate '" + file + "' cannot be read");
  return base::pin_of(*key);
}

}  // namespace

void add_station(CLI::App& app, StationOptions& options) {
  auto* address = app.add_option("--station", options.address, "ADDR:PORT of the station's robot port");
  app.add_option("--data", options.data_dir, "folder of a station that runs on this machine, which says where it is")
      ->type_name("FOLDER")
      ->excludes(address);
  app.add_option("--tls-pin", options.pin,
                 "TLS with the station whose key has this SHA-256, as its certificate is made")
      ->type_name("SHA256");
  app.add_option("--tls-ca", options.authority, "TLS with a station that one of these certificates vouches for")
      ->type_name("FILE");
}

StationAddress station_address(const StationOptions& options) {
  if (options.address.empty() && options.data_dir.empty()) throw CLI::RequiredError("--station or --data");
  const bool is_given = !options.address.empty();
  const nlohmann::json announcement = is_given ? nlohmann::json::object() : announcement_in(options.data_dir);
  StationAddress station = is_given ? parse_station_address(options.address) : announced(announcement);
  const std::string certificate = announcement.value("robots_tls_certificate", "");
  auto pin = options.pin;
  if (!pin && !options.authority && !certificate.empty()) pin = pin_of_certificate(certificate);
  if (pin || options.authority) {
    station.trust = std::make_shared<const StationTrust>(pin, options.authority, station.host);
  }
  return station;
}

}  // namespace sim_robot
