// The file of a job as the body of an answer, piece by piece. It stays whole to its end, also when the station removes
// it meanwhile.
//
// Loop thread; it is read on the reader's thread.
#pragma once

#include <fstream>
#include <memory>

#include "server/http/http.hpp"
#include "server/storage/database/database_reader.hpp"
#include "server/storage/jobs/job_files.hpp"

namespace server::api {

class JobFileStream final : public http::BodyStream {
 public:
  // Null when the file is not there any more.
  static boost::asio::awaitable<std::unique_ptr<JobFileStream>> open(storage::DatabaseReader& reader,
                                                                     storage::JobFile file);

  JobFileStream(storage::DatabaseReader& reader, std::shared_ptr<std::ifstream> file)
      : reader_{reader}, file_{std::move(file)} {}

  boost::asio::awaitable<Result<std::optional<std::string>>> next() override;

 private:
  storage::DatabaseReader& reader_;
  std::shared_ptr<std::ifstream> file_;  // shared with a piece that is being read
};

}  // namespace server::api
