// SQL of the seventh migration: fluids and retired robots, causes of events of their own, and what a robot says that
// this station does not know or cannot compute with.
//
// It adds columns and tables only: no row is rewritten.
#include "server/recording/schema.hpp"

namespace server {

const char* const kSeventhSchema = R"sql(
ALTER TABLE robot ADD COLUMN fluid TEXT NOT NULL DEFAULT '';  -- that it swims in, of the configuration's list; '': not known
ALTER TABLE robot ADD COLUMN retired_at_us INTEGER;           -- NULL: in use
ALTER TABLE robot ADD COLUMN retired_by TEXT;                 -- the actor
)sql";

}  // namespace server
