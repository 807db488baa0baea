// A pool of threads that share the tasks of one call and sleep in between.
#pragma once

#include <sys/types.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <exception>
#include <functional>
#include <mutex>
#include <system_error>
#include <thread>
#include <utility>
#include <vector>

namespace vnca {

class ThreadPool {
public:
    // The pool of this process. It is never destroyed: its threads sleep until the process ends.
    // After a fork the child, which inherits no threads, gets a pool of its own.
    static ThreadPool& of_process() {
        static std::mutex guard;
        static ThreadPool* pool = nullptr;
        const std::lock_guard lock(guard);
        if (pool == nullptr || pool->process_ != getpid()) pool = new ThreadPool;
        return *pool;
    }

    // Runs task(index, worker) for every index in [0, tasks), `worker` < threads telling who does
    // it. Returns when all are done. If a task throws, those not begun are left out and one of the
    // exceptions is thrown here. A second caller at the same time, and one who wants a single
    // thread, does its tasks itself; where no more threads can be had, fewer do.
    void run(int tasks, int threads, const std::function<void(int, int)>& task) {
        const std::unique_lock turn(turn_, std::try_to_lock);
        if (threads > tasks) threads = tasks;
        if (threads < 2 || !turn.owns_lock()) {
            for (int index = 0; index < tasks; ++index) task(index, 0);
            return;
        }
        while (int(workers_.size()) < threads - 1) {
            const int worker = int(workers_.size()) + 1;
            try {
                workers_.emplace_back([this, worker, seen = round_.load()] { work(worker, seen); });
            } catch (const std::system_error&) {
                break;
            }
        }
        task_ = &task;
        tasks_ = tasks;
        threads_ = threads;
        error_ = nullptr;
        next_.store(0, std::memory_order_relaxed);
        busy_.store(int(workers_.size()), std::memory_order_relaxed);
        round_.fetch_add(1, std::memory_order_release);
        round_.notify_all();
        take_tasks(0);
        for (int busy; (busy = busy_.load(std::memory_order_acquire)) != 0;) busy_.wait(busy);
        if (error_) std::rethrow_exception(std::exchange(error_, nullptr));
    }

private:
    void take_tasks(int worker) {
        try {
            for (int index; (index = next_.fetch_add(1, std::memory_order_relaxed)) < tasks_;)
                (*task_)(index, worker);
        } catch (...) {
            next_.store(tasks_, std::memory_order_relaxed);
            const std::lock_guard lock(error_guard_);
            error_ = std::current_exception();
        }
    }

    void work(int worker, std::uint32_t seen) {
        for (;;) {
            round_.wait(seen, std::memory_order_acquire);
            seen = round_.load(std::memory_order_relaxed);  // the next begins after this one ends
            if (worker < threads_) take_tasks(worker);
            if (busy_.fetch_sub(1, std::memory_order_acq_rel) == 1) busy_.notify_one();
        }
    }

    const pid_t process_ = getpid();
    std::mutex turn_;
    std::vector<std::thread> workers_;
    const std::function<void(int, int)>* task_ = nullptr;
    int tasks_ = 0, threads_ = 0;
    std::atomic<std::uint32_t> round_ = 0;
    std::atomic<int> next_ = 0, busy_ = 0;
    std::mutex error_guard_;
    std::exception_ptr error_;
};

}  // namespace vnca
