// Headers that nearly every test of the station needs, compiled once (tests/CMakeLists.txt, STATION).
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "server/runtime/precompiled.hpp"
#include "server/storage/recording_parts.hpp"
