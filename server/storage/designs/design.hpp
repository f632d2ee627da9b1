// A design as a value: a model or a controller that somebody keeps, and where it comes from.
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "server/storage/runs/run.hpp"

namespace server::storage {

using DesignId = std::int64_t;

enum class DesignKind : std::uint8_t { model, controller };
const char* text(DesignKind value);
std::optional<DesignKind> design_kind_from(const std::string& text);

// Of a run that it was found from; the run may be discarded later.
struct DesignSource {
  RunId run = 0;
  std::optional<std::uint32_t> span;  // none: the only one
  bool operator==(const DesignSource&) const = default;
};

// What its maker says of it. Never changed: a change is a new one with a parent.
struct DesignRequest {
  DesignKind kind = DesignKind::model;
  std::string name;
  std::string notes;
  std::string document;            // JSON, which the command line tools read as a plant or a controller
  std::optional<DesignId> parent;  // of the same kind: it is a change of this one
  std::optional<DesignId> model;   // of a controller: designed for it
  std::string options = "{}";      // JSON: how it was made
  std::vector<DesignSource> sources;
};

struct Design {
  DesignId id = 0;
  DesignRequest made;
  std::string sha256;     // of the document
  std::string made_with;  // version of the program
  std::string made_by;    // the actor
  std::int64_t made_at_us = 0;
};

// A controller that a run was made with, and the model that it was designed for.
struct ControllerOfRun {
  Design controller;
  std::optional<Design> model;
};

// Which ones, newest first.
struct DesignFilter {
  std::optional<DesignKind> kind;
  std::optional<RunId> run;  // found from it
  DesignId before = 0;       // 0: from the newest
  std::size_t limit = 100;
};

}  // namespace server::storage
