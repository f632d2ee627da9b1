// Headers that nearly every test of the station needs, compiled once (tests/CMakeLists.txt, STATION).
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/precompiled.hpp"
#include "server/recording/recording_parts.hpp"
