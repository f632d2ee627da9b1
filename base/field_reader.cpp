// Looks each key up, checks type and range, and remembers it as known.
#include "base/field_reader.hpp"

#include <algorithm>
#include <cmath>
#include <sstream>

#include "base/field_list.hpp"
#include "base/invalid_argument.hpp"
#include "base/toml_value.hpp"

namespace base {
namespace {

constexpr std::size_t kMaxShown = 60;

// As it stands in the text, cut when it is long.
std::string shown(const toml::node& node) {
  std::ostringstream text;
  node.visit([&text](const auto& value) { text << value; });
  std::string all = text.str();
  std::ranges::replace(all, '\n', ' ');
  if (all.size() <= kMaxShown) return all;
  std::size_t end = kMaxShown;
  while (end > 0 && (static_cast<unsigned char>(all[end]) & 0xC0U) == 0x80U) --end;  // not within a character
  return all.substr(0, end) + "…";
}

std::size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<std::size_t> row(b.size() + 1);
  for (std::size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (std::size_t i = 1; i <= a.size(); ++i) {
    std::size_t diagonal = row[0];
    row[0] = i;
    for (std::size_t j = 1; j <= b.size(); ++j) {
      const std::size_t above = row[j];
      row[j] = std::min({above + 1, row[j - 1] + 1, diagonal + (a[i - 1] == b[j - 1] ? 0 : 1)});
      diagonal = above;
    }
  }
  return row[b.size()];
}

std::string one_of(const std::string& given, std::span<const std::string> names) {
  const std::string near = nearest(given, names);
  return near.empty() ? "there are " + list_of(names) : "did you mean '" + near + "'? There are " + list_of(names);
}

std::string cut(const std::string& text) {
  return text.size() <= kMaxShown ? text : shown(toml::value<std::string>{text});
}

}  // namespace

std::string nearest(const std::string& text, std::span<const std::string> names) {
  if (text.size() > kMaxShown) return "";
  std::string best;
  std::size_t least = std::max<std::size_t>(2, text.size() / 3) + 1;
  for (const std::string& name : names) {
    const bool is_beginning = text.size() >= 3 && name.starts_with(text);
    const std::size_t distance = is_beginning ? 1 : edit_distance(text, name);
    if (distance >= least) continue;
    least = distance;
    best = name;
  }
  return best;
}

std::string did_you_mean(const std::string& text, std::span<const std::string> names) {
  const std::string near = nearest(text, names);
  return near.empty() ? "" : "; did you mean " + near + "?";
}

std::string list_of(std::span<const std::string> names) {
  std::string all;
  for (const std::string& name : names) all += (all.empty() ? "" : ", ") + name;
  return all;
}

FieldReader::FieldReader(const toml::table& table, const std::string& origin, std::string path)
    : table_(table), origin_(origin), path_(std::move(path)) {}

void FieldReader::fail(const toml::source_position& at, const std::string& key, const std::string& why) const {
  throw_invalid(place(at), path_, key, ": ", why);
}

std::string FieldReader::place(const toml::source_position& at) const {
  std::string text = origin_;
  if (at) text += join_text(":", at.line, ":", at.column);
  return text.empty() ? "" : text + ": ";
}

void FieldReader::fail(const toml::node& node, const std::string& key, const std::string& why) const {
  fail(node.source().begin, key, why);
}

// A key of the table that is nearly the one that is missing.
std::string FieldReader::meant_for(const std::string& key) const {
  const std::vector<std::string> wanted{key};
  for (const auto& [given, value] : table_) {
    const std::string name{given.str()};
    if (std::ranges::find(known_, name) == known_.end() && !nearest(name, wanted).empty()) {
      return join_text("; is '", cut(name), "' in line ", given.source().begin.line, " meant for it?");
    }
  }
  return "";
}

const toml::node* FieldReader::find(const char* key, bool must_be_given, const char* what) {
  known_.emplace_back(key);
  const toml::node* node = table_.get(key);
  if (node == nullptr && must_be_given) fail(table_, key, std::string("must be given: ") + what + meant_for(key));
  return node;
}

void FieldReader::number(const char* key, double& value, Range range, const char* what) {
  const toml::node* node = find(key, std::isnan(value), what);
  if (node == nullptr) return;
  const auto given = exact<double>(*node);
  if (!given) fail(*node, key, "must be a number, is " + shown(*node));
  if (!range.holds(*given)) fail(*node, key, "is " + shown(*node) + ", allowed is " + range_text(range));
  value = *given;
}

void FieldReader::whole(const char* key, std::uint64_t& value, Range range, const char* what) {
  const toml::node* node = find(key, false, what);
  if (node == nullptr) return;
  const auto given = exact<std::int64_t>(*node);
  if (!given) fail(*node, key, "must be a whole number, is " + shown(*node));
  if (*given < 0 || !range.holds(static_cast<double>(*given))) {
    fail(*node, key, "is " + shown(*node) + ", allowed is " + range_text(range));
  }
  value = static_cast<std::uint64_t>(*given);
}

void FieldReader::flag(const char* key, bool& value, const char* what) {
  const toml::node* node = find(key, false, what);
  if (node == nullptr) return;
  const auto given = exact<bool>(*node);
  if (!given) fail(*node, key, "must be true or false, is " + shown(*node));
  value = *given;
}

void FieldReader::text(const char* key, std::string& value, const char* what) {
  const toml::node* node = find(key, value.empty(), what);
  if (node == nullptr) return;
  const auto given = exact<std::string>(*node);
  if (!given) fail(*node, key, "must be a text in quotes, is " + shown(*node));
  value = *given;
}

void FieldReader::choice(const char* key, std::size_t& index, std::span<const char* const> names, const char* what) {
  const toml::node* node = find(key, index >= names.size(), what);
  if (node == nullptr) return;
  const std::vector<std::string> known(names.begin(), names.end());
  if (!node->is_string())
    fail(*node, key, "must be a text in quotes, is " + shown(*node) + "; there are " + list_of(known));
  const std::string& given = node->as_string()->get();
  const auto found = std::ranges::find(known, given);
  if (found == known.end()) fail(*node, key, "there is no '" + cut(given) + "'; " + one_of(given, known));
  index = static_cast<std::size_t>(found - known.begin());
}

void FieldReader::numbers(const char* key, std::vector<double>& values, Range range, const char* what) {
  const toml::array* all = find_list(key, what, "[0.5, 1]");
  if (all != nullptr) values.clear();
  for (std::size_t i = 0; all != nullptr && i < all->size(); ++i) {
    const toml::node& node = *all->get(i);
    const std::string name = join_text(key, "[", i, "]");
    const auto given = exact<double>(node);
    if (!given) fail(node, name, "must be a number, is " + shown(node));
    if (!range.holds(*given)) fail(node, name, "is " + shown(node) + ", allowed is " + range_text(range));
    values.push_back(*given);
  }
}

void FieldReader::texts(const char* key, std::vector<std::string>& values, const char* what) {
  const toml::array* all = find_list(key, what, "[\"water\"]");
  if (all != nullptr) values.clear();
  for (std::size_t i = 0; all != nullptr && i < all->size(); ++i) {
    const toml::node& node = *all->get(i);
    const auto given = exact<std::string>(node);
    if (!given || given->empty()) {
      fail(node, join_text(key, "[", i, "]"), "must be a text in quotes that is not empty, is " + shown(node));
    }
    values.push_back(*given);
  }
}

const toml::array* FieldReader::find_list(const char* key, const char* what, const char* example) {
  const toml::node* node = find(key, false, what);
  if (node == nullptr) return nullptr;
  if (!node->is_array()) fail(*node, key, join_text("must be a list such as ", example, ", is ", shown(*node)));
  return node->as_array();
}

void FieldReader::read_table(const toml::node& node, const std::string& key, const Inside& inside) const {
  const toml::table* table = node.as_table();
  if (table == nullptr) fail(node, key, "must be a table, is " + shown(node));
  FieldReader reader{*table, origin_, path_ + key + "."};
  inside(reader);
  reader.finish();
}

void FieldReader::table(const char* key, const char* what, const Inside& inside) {
  const toml::node* node = find(key, false, what);
  if (node != nullptr) read_table(*node, key, inside);
}

void FieldReader::tables(const char* key, const char* what, const Inside& inside) {
  const toml::node* node = find(key, false, what);
  if (node == nullptr) return;
  const toml::array* all = node->as_array();
  if (all == nullptr) fail(*node, key, "must be a list of tables, [[" + path_ + key + "]], is " + shown(*node));
  for (std::size_t i = 0; i < all->size(); ++i) {
    read_table(*all->get(i), join_text(key, "[", i, "]"), inside);
  }
}

// At the key that the error speaks of, if it is in the table.
void FieldReader::must(const std::function<void()>& check) {
  try {
    check();
  } catch (const std::invalid_argument& error) {
    const std::string why = error.what();
    for (const auto& [key, value] : table_) {
      const std::string name{key.str()};
      if (std::ranges::find(known_, name) != known_.end() && why.find(name) != std::string::npos)
        fail(value, name, why);
    }
    const std::string table = path_.empty() ? "" : path_.substr(0, path_.size() - 1) + ": ";
    throw_invalid(place(table_.source().begin), table, why);
  }
}

void FieldReader::finish() const {
  for (const auto& [key, value] : table_) {
    const std::string name{key.str()};
    if (std::ranges::find(known_, name) != known_.end()) continue;
    fail(key.source().begin, cut(name), "is no key here; " + one_of(name, known_));
  }
}

}  // namespace base
