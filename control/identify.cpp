// Searches, compares and judges.
#include "control/identify.hpp"
