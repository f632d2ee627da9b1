// Asks the station that runs in a data folder, over loopback and with its own token: for tools that must not write into
// the database themselves. In TLS only the station with the certificate that the folder announces gets the token.
#pragma once

#include <boost/asio/ip/tcp.hpp>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>

namespace server::cli {

struct StationAnswer {
  int status = 0;
  nlohmann::json body;  // of an error: problem details; null of a page
  std::string text;     // of what is not JSON
};

// The body of an answer that is a success. Throws std::runtime_error saying what the station refused.
nlohmann::json asked(StationAnswer answer);

class StationClient {
 public:
  // Reads endpoints.json and rheonaut.token. Throws std::runtime_error when either is not there.
  explicit StationClient(const std::filesystem::path& data_dir);

  // One connection a request. Throws std::runtime_error when nobody answers in JSON.
  StationAnswer ask(const std::string& method, const std::string& target, const nlohmann::json& body = nullptr) const;

  // The body of GET as a file, whatever its size; one that is there is replaced when it is whole. Throws
  // std::runtime_error saying what the station refused, or that it cannot be written.
  void save(const std::string& target, const std::filesystem::path& file) const;

 private:
  template <class Talk>
  StationAnswer with_connection(const Talk& talk) const;

  boost::asio::ip::tcp::endpoint endpoint_;
  std::filesystem::path certificate_;  // empty: plain HTTP
  std::string token_;
};

}  // namespace server::cli
