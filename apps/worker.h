// SPDX-License-Identifier: GPL-2.0-or-later
#pragma once
/// \file
/// A thread beside the one that works on the frames.

#include <condition_variable>
#include <deque>
#include <functional>
#include <future>
#include <memory>
#include <mutex>
#include <thread>

namespace bole::apps
{
/// One thread that does what it is given, in this order, and all of it before it ends. A thread for each frame would
/// not do for a flight without end: OpenCV keeps something for every thread that there ever was.
class Worker
{
public:
  Worker() : m_thread([this] { run(); }) {}
  ~Worker()
  {
    give({});
    m_thread.join();
  }
  Worker(const Worker &) = delete;
  Worker &operator=(const Worker &) = delete;

  /// Its result or exception is that of \p action.
  template <typename Action> auto operator()(Action action) -> std::future<decltype(action())>
  {
    const auto task = std::make_shared<std::packaged_task<decltype(action())()>>(std::move(action));
    give([task] { (*task)(); });
    return task->get_future();
  }

private:
  /// \p task: empty to end.
  void give(std::function<void()> task)
  {
    {
      const std::lock_guard<std::mutex> lock(m_mutex);
      m_tasks.push_back(std::move(task));
    }
    m_given.notify_one();
  }

  void run()
  {
    while (true) {
      std::unique_lock<std::mutex> lock(m_mutex);
      m_given.wait(lock, [this] { return !m_tasks.empty(); });
      const std::function<void()> task = std::move(m_tasks.front());
      m_tasks.pop_front();
      lock.unlock();
      if (!task)
        return;
      task();
    }
  }

  std::mutex m_mutex;
  std::condition_variable m_given;
  std::deque<std::function<void()>> m_tasks;
  std::thread m_thread;
};
} // namespace bole::apps
