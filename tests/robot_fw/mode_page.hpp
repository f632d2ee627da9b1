// The tables of commands and events in docs/robot.md, read as data.
#pragma once

#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <sstream>
#include <string>
#include <vector>

namespace robot_fw {

struct PageRow {
  std::string name;
  std::vector<std::string> notes;            // kinds of events
  std::string cause;                         // of the events
  std::string latches;                       // the cause of an emergency
  std::map<std::string, std::string> cells;  // by state
};
using PageTable = std::map<std::string, PageRow>;

// "| a | `b` c |" -> "a", "b c"
inline std::vector<std::string> cells_of(const std::string& line) {
  std::vector<std::string> cells;
  std::string cell;
  for (const char c : line.substr(1)) {
    if (c == '|') {
      const auto first = cell.find_first_not_of(' '), last = cell.find_last_not_of(' ');
      cells.push_back(first == std::string::npos ? "" : cell.substr(first, last - first + 1));
      cell.clear();
    } else if (c != '`') {
      cell += c;
    }
  }
  return cells;
}

// The table whose first column has this heading and that has a column for each state. A row too short, too long or
// named twice fails the test.
inline PageTable page_table(const std::string& heading) {
  std::ifstream page{DOCS_DIR "/robot.md"};
  PageTable table;
  std::vector<std::string> head;
  for (std::string line; std::getline(page, line);) {
    const auto cells = line.starts_with("|") ? cells_of(line) : std::vector<std::string>{};
    if (head.empty()) {
      const bool begins = cells.size() > 2 && cells[0] == heading && cells[1] == "notes";
      if (begins) head = cells;
      continue;
    }
    if (cells.empty()) break;
    if (cells[0].starts_with("-")) continue;
    EXPECT_EQ(cells.size(), head.size()) << line;
    if (cells.size() != head.size()) continue;
    PageRow row{cells[0], {}, "command", "operator", {}};
    for (std::size_t i = 1; i < cells.size(); ++i) {
      if (head[i] == "notes") {
        std::istringstream words{cells[i]};
        for (std::string word; words >> word;) row.notes.push_back(word);
      } else if (head[i] == "cause") {
        row.cause = cells[i];
      } else if (head[i] == "latches") {
        row.latches = cells[i];
      } else {
        row.cells[head[i]] = cells[i];
      }
    }
    EXPECT_TRUE(table.emplace(row.name, row).second) << row.name << " is there twice";
  }
  EXPECT_FALSE(table.empty()) << "no table of each " << heading;
  return table;
}

}  // namespace robot_fw
