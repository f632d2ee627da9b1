// The table shows what the reference cases show.
#include "control/robustness.hpp"

#include <gtest/gtest.h>
