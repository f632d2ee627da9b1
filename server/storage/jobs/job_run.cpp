// A report reaches the loop as a value.
#include "server/storage/jobs/job_run.hpp"

#include <boost/asio/post.hpp>

namespace server::storage {

void JobRun::report(double share, std::string stage) {
  boost::asio::post(loop_, [progress = progress_, now = JobProgress{share, std::move(stage)}]() mutable {
    *progress = std::move(now);
  });
}

}  // namespace server::storage
