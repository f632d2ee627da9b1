// Runs the table.
#include "control/robustness.hpp"
