// Identification meets the reference optima and says what a run cannot tell.
#include "control/identify.hpp"

#include <gtest/gtest.h>
