// Answers with embedded files.
#include "server/api/routes/assets.hpp"

#include <algorithm>

namespace server {

Response asset_response(const Request& request, const Asset& asset) {
  Response response;
  response.content_type = asset.content_type;
  response.headers.emplace_back("ETag", asset.etag);
  const bool hashed = std::string_view{asset.path}.starts_with("/assets/");
  response.headers.emplace_back("Cache-Control", hashed ? "public, max-age=31536000, immutable" : "no-cache");
  if (request.header("if-none-match").find(asset.etag) != std::string::npos) {
    response.status = 304;
    return response;
  }
  response.body.assign(asset.begin, asset.begin + asset.size);
  return response;
}

Response page_response(const Request& request) {
  if (request.method != "GET" && request.method != "HEAD") {
    Response response = problem(405, request.method + " is not possible here", "method_not_allowed");
    response.headers.emplace_back("Allow", "GET, HEAD");
    return response;
  }
  const std::string path = request.path == "/" ? "/index.html" : request.path;
  const auto assets = page_assets();
  const auto found = std::ranges::find_if(assets, [&path](const Asset& asset) { return path == asset.path; });
  if (found != assets.end()) return asset_response(request, *found);
  if (path == "/index.html") {
    return html_response(200,
                         "<!doctype html><title>Rheonaut</title><p>This station was built without the cockpit. Its API "
                         "answers under /api/v1; build the target web_dist and then the station to have the page.");
  }
  return problem(404, "there is nothing at this path", "unknown_path");
}

}  // namespace server
