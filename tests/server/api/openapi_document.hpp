// server/api/openapi.yaml as JSON, for tests that compare it with the code.
#pragma once

#include <nlohmann/json.hpp>

namespace server {

// Reads the part of YAML in which the document is written: mappings and lists in blocks or braces, plain and quoted
// texts, and blocks of text ("|", ">-"). Throws for anything else.
nlohmann::json openapi_document();

}  // namespace server
