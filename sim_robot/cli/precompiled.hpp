// Headers that nearly every subcommand of rheonaut-sim needs, compiled once.
#pragma once

#include <CLI/CLI.hpp>

#include "sim_robot/client/precompiled.hpp"
