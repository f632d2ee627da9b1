// What the goldens are made of: a story that a station records, with everything in it that is hard to write down.
//
// It begins on the database of schema version 6 in tests/data/recording, whose first run has a digest of format 1. The
// database that it ends with is kept as tests/data/goldens/database.sql. The story is made again in each test, so that
// the writing is held to it as well; the tests of reading begin with that file, so that they show what reading changed
// and nothing else. It is text, so that a difference can be read.
#pragma once

#include <string>
#include <utility>
#include <vector>

namespace server {

struct Story {
  std::string database;                                        // as database_text() says it
  std::vector<std::pair<std::string, std::string>> documents;  // name of a golden, text
};

Story record_story();

}  // namespace server
