// Parallel sections are the transfer function they were made from.
#include "control/sections.hpp"

#include <gtest/gtest.h>
