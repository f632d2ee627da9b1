// The names of the kinds.
#include "server/storage/designs/design.hpp"

namespace server::storage {

const char* text(DesignKind value) { return value == DesignKind::model ? "model" : "controller"; }

std::optional<DesignKind> design_kind_from(const std::string& given) {
  for (const DesignKind kind : {DesignKind::model, DesignKind::controller}) {
    if (given == text(kind)) return kind;
  }
  return std::nullopt;
}

}  // namespace server::storage
