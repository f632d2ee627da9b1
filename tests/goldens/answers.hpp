// Answers of the API as the text of a golden: status line, head and body as they are sent.
#pragma once

#include <string>

#include "tests/server/api/api_fixture.hpp"

namespace server {

// "GET /api/v1/runs?limit=1", then status, content type and further headers, then the body.
std::string answer_text(const std::string& target, const Answered& answered);

// The figures' names, types and meanings, without their values: these are of the machine and the moment.
std::string without_values(const std::string& metrics);

// The port is any free one, and sizes of the database are those of SQLite's pages: 0 instead.
std::string without_port_and_sizes(const std::string& text);

// The head of a MAT file has the date on which it was made, and the version of the library that made it: spaces
// instead.
std::string without_date(std::string mat);

}  // namespace server
