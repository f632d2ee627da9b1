// The fuzz targets: each is given any bytes, and aborts when something that must hold of them does not. All return 0.
#pragma once

#include <cstddef>
#include <cstdint>

namespace fuzz {

int body(const std::uint8_t* data, std::size_t size);      // bodies of requests, and messages on /live
int config(const std::uint8_t* data, std::size_t size);    // the station's configuration file
int cookie(const std::uint8_t* data, std::size_t size);    // header fields, and who is let in
int foxglove(const std::uint8_t* data, std::size_t size);  // messages of Foxglove's clients
int frame(const std::uint8_t* data, std::size_t size);     // frames of the protocol, in both directions
int profile(const std::uint8_t* data, std::size_t size);   // profiles of experiments
int query(const std::uint8_t* data, std::size_t size);     // path and parameters of a request
int robot(const std::uint8_t* data, std::size_t size);     // a robot in motion
int scenario(const std::uint8_t* data, std::size_t size);  // scenarios and faults of the simulated robot

}  // namespace fuzz
