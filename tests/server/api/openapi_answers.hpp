// Holds answers of the station to server/api/openapi.yaml: statuses, types of content, and bodies by their schemas.
#pragma once

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace server {

// What is wrong with the value by the schema, a sentence each; empty: nothing. The part of JSON Schema that the
// document uses. An object with `properties` has no others, unless the schema allows them. A length is counted in
// bytes, as the station does.
std::vector<std::string> schema_faults(const nlohmann::json& schema, const nlohmann::json& value);

// Of an answer to an operation such as "GET", "/api/v1/runs/{run_id}".
std::vector<std::string> answer_faults(const std::string& method, const std::string& pattern, int status,
                                       const std::string& content_type, const std::string& body);

}  // namespace server
