// Answers with embedded files.
#include "server/api/routes/assets.hpp"

#include <zlib.h>

#include <algorithm>
#include <array>
#include <stdexcept>
#include <string>
#include <utility>

namespace server::api {
namespace {

constexpr std::string_view kCompressed = ".gz";

constexpr std::array<std::pair<std::string_view, const char*>, 13> kContentTypes{{
    {".html", "text/html; charset=utf-8"},
    {".js", "text/javascript; charset=utf-8"},
    {".css", "text/css; charset=utf-8"},
    {".json", "application/json"},
    {".map", "application/json"},
    {".webmanifest", "application/manifest+json"},
    {".svg", "image/svg+xml"},
    {".png", "image/png"},
    {".ico", "image/x-icon"},
    {".woff", "font/woff"},
    {".woff2", "font/woff2"},
    {".txt", "text/plain; charset=utf-8"},
    {".yaml", "application/yaml; charset=utf-8"},
}};

const char* content_type_of(std::string_view name) {
  const std::string_view ending = name.substr(std::min(name.rfind('.'), name.size()));
  const auto found = std::ranges::find(kContentTypes, ending, [](const auto& known) { return known.first; });
  return found == kContentTypes.end() ? "application/octet-stream" : found->second;
}

// Whether Accept-Encoding names gzip, or anything, and not with a weight of 0 (RFC 9110, 12.5.3).
bool takes_gzip(const http::Request& request) {
  std::string accepted = request.header("accept-encoding");
  std::erase(accepted, ' ');
  bool takes_any = false;
  for (std::size_t at = 0; at < accepted.size();) {
    const std::size_t end = std::min(accepted.find(',', at), accepted.size());
    const std::string_view coding = std::string_view{accepted}.substr(at, end - at);
    const std::string_view name = coding.substr(0, coding.find(';'));
    const std::size_t weight = coding.find(";q=");
    const bool is_refused =
        weight != std::string_view::npos && coding.find_first_not_of("0.", weight + 3) == std::string_view::npos;
    if (name == "gzip") return !is_refused;
    if (name == "*") takes_any = !is_refused;
    at = end + 1;
  }
  return takes_any;
}

// The text in a file that the build has compressed. Throws std::logic_error when it is not one.
std::string expanded(std::string_view gzip) {
  // Its last four bytes are its length, the lowest first.
  std::size_t size = 0;
  for (std::size_t i = 0; i < 4; ++i) size = size << 8U | static_cast<unsigned char>(gzip[gzip.size() - 1 - i]);
  std::string text(size, '\0');
  z_stream stream{};
  if (inflateInit2(&stream, MAX_WBITS + 16) != Z_OK) throw std::logic_error{"zlib does not begin"};
  stream.next_in = reinterpret_cast<z_const Bytef*>(const_cast<char*>(gzip.data()));  // zlib only reads it
  stream.avail_in = static_cast<uInt>(gzip.size());
  stream.next_out = reinterpret_cast<Bytef*>(text.data());
  stream.avail_out = static_cast<uInt>(text.size());
  const int ended = inflate(&stream, Z_FINISH);
  inflateEnd(&stream);
  if (ended != Z_STREAM_END || stream.avail_out != 0) throw std::logic_error{"an embedded file is damaged"};
  return text;
}

// The file of the cockpit at the path, compressed or not; nullptr when there is none.
const base::EmbeddedFile* cockpit_file(std::string_view path) {
  const auto files = cockpit_files();
  const auto found = std::ranges::find_if(files, [path](const base::EmbeddedFile& file) {
    return file.name == path || (file.name.starts_with(path) && file.name.substr(path.size()) == kCompressed);
  });
  return found == files.end() ? nullptr : &*found;
}

}  // namespace

http::Response asset_response(const http::Request& request, const base::EmbeddedFile& file) {
  const bool is_compressed = file.name.ends_with(kCompressed);
  const bool is_expanded = is_compressed && !takes_gzip(request);
  const std::string etag = '"' + std::string{file.digest} + (is_expanded ? "-plain\"" : "\"");
  const std::string_view name = file.name.substr(0, file.name.size() - (is_compressed ? kCompressed.size() : 0));
  http::Response response;
  response.content_type = content_type_of(name);
  response.headers.emplace_back("ETag", etag);
  const bool hashed = name.starts_with("/assets/");
  response.headers.emplace_back("Cache-Control", hashed ? "public, max-age=31536000, immutable" : "no-cache");
  if (is_compressed) response.headers.emplace_back("Vary", "Accept-Encoding");
  if (request.header("if-none-match").find(etag) != std::string::npos) {
    response.status = 304;
    return response;
  }
  if (is_compressed && !is_expanded) response.headers.emplace_back("Content-Encoding", "gzip");
  response.body = is_expanded ? expanded(file.content) : std::string{file.content};
  return response;
}

http::Response page_response(const http::Request& request) {
  if (request.method != "GET" && request.method != "HEAD") {
    http::Response response = http::problem(405, request.method + " is not possible here", "method_not_allowed");
    response.headers.emplace_back("Allow", "GET, HEAD");
    return response;
  }
  const std::string path = request.path == "/" ? "/index.html" : request.path;
  if (const base::EmbeddedFile* file = cockpit_file(path)) return asset_response(request, *file);
  if (path == "/index.html") {
    return http::html_response(
        200,
        "<!doctype html><title>Rheonaut</title><p>This station was built without the cockpit. Its API "
        "answers under /api/v1; build the target web_dist and then the station to have the page.");
  }
  return http::problem(404, "there is nothing at this path", "unknown_path");
}

}  // namespace server::api
