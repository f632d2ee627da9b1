// Fits, measures and chooses.
#include "control/discretise.hpp"
