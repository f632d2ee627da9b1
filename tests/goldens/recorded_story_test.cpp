// What a station writes of the story, what pages hear of it, and a database in which nothing happened.
#include "tests/goldens/recorded_story.hpp"

#include "server/storage/database/database.hpp"
#include "tests/goldens/database_text.hpp"
#include "tests/goldens/golden_file.hpp"
#include "tests/server/api/api_fixture.hpp"

namespace server {
namespace {

TEST(GoldenStory, IsRecordedAndReportedAsItWas) {
  const Story story = record_story();
  for (const auto& [name, text] : story.documents) expect_golden(name, text);
  expect_golden("database.sql", story.database);
}

TEST(GoldenSchema, OfAFreshDatabase) {
  const TemporaryFolder folder;
  const auto path = folder.path() / "station.sqlite";
  {
    const storage::Database database{path};
  }
  expect_golden("schema.sql", schema_text(path));
}

}  // namespace
}  // namespace server
