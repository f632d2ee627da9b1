// The files of the cockpit and openapi.yaml as answers; they are embedded in the program.
#pragma once

#include <span>
#include <string_view>

#include "base/embedded_file.hpp"
#include "server/http/http.hpp"

namespace server::api {

// The cockpit's files by path, "index.html" as "/index.html"; a text is compressed and has ".gz" behind its path
// (cmake/gzip_texts.py). None when the cockpit was not built.
std::span<const base::EmbeddedFile> cockpit_files();
// One file, openapi.yaml.
std::span<const base::EmbeddedFile> openapi_files();

// The file with its ETag: 304 when the client has it. Files under /assets/ carry a hash in their name and never change;
// everything else is asked for again each time. The content type follows from the file's ending. A file "….gz" is
// answered as what is compressed in it: as it is when the client takes gzip, else expanded.
http::Response asset_response(const http::Request& request, const base::EmbeddedFile& file);

// The cockpit's file at request.path ("/" is index.html); 404 when there is none, 405 for anything but GET.
http::Response page_response(const http::Request& request);

}  // namespace server::api
