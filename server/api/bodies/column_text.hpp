// Recorded values as JSON text: pages of samples, overviews, and missing samples; spelled as openapi.yaml says.
//
// Written without a JSON tree, since it is long. Still takes milliseconds: on a worker, never on the loop.
#pragma once

#include <string>

#include "server/storage/query/history.hpp"

namespace server {

std::string page_text(const SegmentPage& page);                          // SamplePage
std::string overview_text(const Overview& overview, Channels channels);  // Overview
std::string absences_text(const AbsencePage& page);                      // GapList

}  // namespace server
