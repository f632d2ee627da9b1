// Partial fractions and their filters.
#include "control/sections.hpp"
