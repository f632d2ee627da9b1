// The table of causes, by the type of the exception and its code.
#include "base/failures/words.hpp"

#include <array>
#include <boost/asio/error.hpp>
#include <boost/asio/ssl/error.hpp>
#include <boost/beast/http/error.hpp>
#include <boost/beast/websocket/error.hpp>
#include <boost/core/demangle.hpp>
#include <boost/system/system_error.hpp>
#include <filesystem>
#include <new>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <system_error>
#include <typeinfo>
#include <utility>

#include "base/json_text.hpp"

namespace base::failures {
namespace error = boost::asio::error;
namespace http = boost::beast::http;

std::string words_of(const boost::system::error_code& code) {
  using Words = std::pair<boost::system::error_code, const char*>;
  static const std::array kWords{
      Words{error::connection_refused, "nothing listens there"},
      Words{error::eof, "it closed the connection"},
      Words{http::error::end_of_stream, "it closed the connection"},
      Words{http::error::partial_message, "it closed the connection before all was said"},
      Words{error::connection_reset, "it broke the connection"},
      Words{error::broken_pipe, "it broke the connection"},
      Words{boost::asio::ssl::error::stream_truncated, "it broke the connection"},
      Words{boost::beast::websocket::error::closed, "it closed the connection"},
      Words{error::timed_out, "it does not answer"},
      Words{error::host_unreachable, "no way leads to that address"},
      Words{error::network_unreachable, "no way leads to that address"},
      Words{error::host_not_found, "no computer of that name is known"},
      Words{error::address_in_use, "another program listens on that address"},
      Words{error::access_denied, "it is not permitted"},
      Words{error::no_descriptors, "too many files and connections are open"},
      Words{error::no_memory, "no memory is left"},
      Words{error::operation_aborted, "it was cancelled"},
  };
  for (const auto& [known, words] : kWords) {
    if (code == known) return words;
  }
  return code.message();
}

namespace {

// As thrown, not what a library derives from it.
bool is_own(const std::exception& failure) {
  if (dynamic_cast<const Worded*>(&failure) != nullptr) return true;
  const std::type_info& type = typeid(failure);
  return type == typeid(std::invalid_argument) || type == typeid(std::runtime_error) ||
         type == typeid(std::logic_error) || type == typeid(std::system_error);
}

}  // namespace

std::string words_of(const std::exception& failure) {
  if (is_own(failure)) return failure.what();
  if (const auto* of_boost = dynamic_cast<const boost::system::system_error*>(&failure)) {
    return words_of(of_boost->code());
  }
  if (const auto* of_files = dynamic_cast<const std::filesystem::filesystem_error*>(&failure)) {
    return "'" + of_files->path1().string() + "': " + of_files->code().message();
  }
  if (dynamic_cast<const std::bad_alloc*>(&failure) != nullptr) return "no memory is left";
  if (const auto* of_json = dynamic_cast<const nlohmann::json::parse_error*>(&failure)) {
    return "it is not JSON: " + fault_of(*of_json);
  }
  if (dynamic_cast<const nlohmann::json::exception*>(&failure) != nullptr) {
    return "something that it must say is missing, or of another kind";
  }
  if (const auto* of_system = dynamic_cast<const std::system_error*>(&failure)) return of_system->code().message();
  return "a fault of this program (" + boost::core::demangle(typeid(failure).name()) + ")";
}

}  // namespace base::failures
