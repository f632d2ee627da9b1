// Reads a TOML value as exactly the type of its key: 1 is no text, "1" no number and 1.5 no whole number.
#pragma once

#include <toml++/toml.h>

#include <optional>
#include <type_traits>

namespace base {

// T is bool, std::string, std::int64_t or double, which also takes whole numbers. Nothing when the value is another.
template <class T>
std::optional<T> exact(const toml::node& node) {
  if constexpr (std::is_same_v<T, double>) {
    return node.is_number() ? node.value<double>() : std::nullopt;
  } else {
    return node.value_exact<T>();
  }
}

}  // namespace base
