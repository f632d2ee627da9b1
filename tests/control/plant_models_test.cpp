// The hydrodynamic model meets the one that the paper prints, where it can.
#include "control/plant_models.hpp"

#include <gtest/gtest.h>
