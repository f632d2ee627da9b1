// Scans for crossovers and peaks, and polishes them.
#include "control/margins.hpp"
