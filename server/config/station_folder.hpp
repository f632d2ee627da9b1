// The data folder of a station that is about to run, on a disk and under limits that let it.
#pragma once

#include "server/config/config.hpp"
#include "server/config/data_folder.hpp"

namespace server::config {

// As DataFolder; also refuses a new store on a file system that damages it, unless the configuration says so, and warns
// of one that is there, and of limits of the system that are too tight.
DataFolder station_folder(const Config& config);

}  // namespace server::config
