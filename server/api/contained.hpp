// A task whose failure is its own: what it throws is logged with its name and ends it alone, never the station.
#pragma once

#include <spdlog/spdlog.h>

#include <boost/asio/awaitable.hpp>
#include <boost/asio/error.hpp>
#include <boost/system/system_error.hpp>
#include <string>
#include <utility>

namespace server {

// For what people cause: a page, a stop, a renewal. Throws operation_aborted when cancelled, and nothing else.
inline boost::asio::awaitable<void> contained(std::string name, boost::asio::awaitable<void> task) {
  try {
    co_await std::move(task);
  } catch (const boost::system::system_error& error) {
    if (error.code() == boost::asio::error::operation_aborted) throw;
    spdlog::error("{}: {}", name, error.what());
  } catch (const std::exception& error) {
    spdlog::error("{}: {}", name, error.what());
  }
}

}  // namespace server
