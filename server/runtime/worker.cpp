// Names the worker's thread and lowers its priority.
#include "server/runtime/worker.hpp"

#include <pthread.h>
#include <sys/resource.h>
#include <unistd.h>

#include <boost/asio/post.hpp>

namespace server::runtime {

WorkerThread::WorkerThread(std::string name, int niceness) {
  auto set_up = [name = std::move(name), niceness] {
    pthread_setname_np(pthread_self(), name.substr(0, 15).c_str());
    if (niceness != 0) setpriority(PRIO_PROCESS, static_cast<id_t>(gettid()), niceness);
  };
  boost::asio::post(pool_, std::move(set_up));
}

WorkerThread::~WorkerThread() { pool_.join(); }

}  // namespace server::runtime
