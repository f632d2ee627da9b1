// Who uses the command line, for the audit: "cli:" and the user of the operating system.
#pragma once

#include "server/station/state/audit_note.hpp"

namespace server::cli {

station::Author command_line_author();  // now

}  // namespace server::cli
