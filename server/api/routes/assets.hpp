// The files of the cockpit and openapi.yaml, embedded in the program by embed_assets.py.
#pragma once

#include <cstddef>
#include <span>
#include <string>

#include "server/http/http.hpp"

namespace server {

struct Asset {
  const char* path;  // as in the URL: "/index.html", "/assets/main-3f2a.js"
  const char* content_type;
  const char* etag;  // quoted
  const unsigned char* begin;
  std::size_t size;
};

// The generated table: the cockpit's files; empty when the cockpit was not built.
std::span<const Asset> page_assets();
const Asset& openapi_document();

// The file with its ETag: 304 when the asker has it. Files under /assets/ carry a hash in their name and never change;
// everything else is asked for again each time.
Response asset_response(const Request& request, const Asset& asset);

// The cockpit's file at request.path ("/" is index.html); 404 when there is none, 405 for anything but GET.
Response page_response(const Request& request);

}  // namespace server
