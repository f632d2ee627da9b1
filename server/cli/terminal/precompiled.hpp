// Headers that nearly every tool of the command line needs, compiled once.
#pragma once

#include <fmt/format.h>
#include <fmt/ostream.h>

#include <CLI/CLI.hpp>
#include <filesystem>

#include "server/runtime/precompiled.hpp"
