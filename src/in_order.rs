//! Work that any thread may do and that is taken in order.

use std::collections::VecDeque;
use std::sync::{Mutex, MutexGuard, PoisonError};

use rayon::Scope;

/// Makes the items 0 to `count` on all threads, and has each taken by one thread at a time, in order. No more than
/// `ahead` items are being made or wait to be taken, and no thread waits while there is one to make.
///
/// Nothing is taken after the first error, by its place and not by its time; it is what is returned.
pub fn in_order<T: Send, E: Send>(
    count: usize,
    ahead: usize,
    make: impl Fn(usize) -> Result<T, E> + Sync,
    take: impl FnMut(T) -> Result<(), E> + Send,
) -> Result<(), E> {
    let queue = Queue { next: 0, first: 0, made: VecDeque::new(), take: Some(take), error: None };
    let line = Line { count, make, queue: Mutex::new(queue) };
    rayon::scope(|scope| {
        for _ in 0..ahead.clamp(1, count.max(1)) {
            scope.spawn(|scope| line.work(scope));
        }
    });
    line.queue.into_inner().unwrap_or_else(PoisonError::into_inner).error.map_or(Ok(()), Err)
}

struct Line<M, K, T, E> {
    count: usize,
    make: M,
    queue: Mutex<Queue<K, T, E>>,
}

struct Queue<K, T, E> {
    /// The next item to make.
    next: usize,
    /// The next item to take, and what is made of those from there on.
    first: usize,
    made: VecDeque<Option<Result<T, E>>>,
    /// None while a thread takes.
    take: Option<K>,
    error: Option<E>,
}

impl<M, K, T, E> Line<M, K, T, E>
where
    M: Fn(usize) -> Result<T, E> + Sync,
    K: FnMut(T) -> Result<(), E> + Send,
    T: Send,
    E: Send,
{
    fn queue(&self) -> MutexGuard<'_, Queue<K, T, E>> {
        // A panic of either function ends the scope, which hands it on.
        self.queue.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Makes the next item, then takes all that can be taken.
    fn work<'scope>(&'scope self, scope: &Scope<'scope>) {
        let index = {
            let mut queue = self.queue();
            if queue.next == self.count || queue.error.is_some() {
                return;
            }
            queue.next += 1;
            queue.next - 1
        };
        let item = (self.make)(index);
        let mut queue = self.queue();
        let place = index - queue.first;
        if queue.made.len() <= place {
            queue.made.resize_with(place + 1, || None);
        }
        queue.made[place] = Some(item);
        while queue.error.is_none()
            && queue.take.is_some()
            && let Some(Some(item)) = queue.made.front_mut().map(Option::take)
        {
            queue.made.pop_front();
            queue.first += 1;
            let Some(mut take) = queue.take.take() else { return };
            drop(queue);
            let taken = item.and_then(&mut take);
            scope.spawn(|scope| self.work(scope));
            queue = self.queue();
            queue.take = Some(take);
            queue.error = taken.err();
        }
    }
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};
    use std::time::Duration;

    use super::*;

    fn pool(threads: usize) -> rayon::ThreadPool {
        rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads")
    }

    #[test]
    fn items_are_taken_in_order_and_not_too_many_are_held() {
        for (threads, ahead) in [(1, 1), (1, 5), (4, 1), (4, 3), (8, 100)] {
            let held = AtomicUsize::new(0);
            let most = AtomicUsize::new(0);
            let mut taken = Vec::new();
            let make = |index: usize| -> Result<usize, ()> {
                most.fetch_max(1 + held.fetch_add(1, Ordering::SeqCst), Ordering::SeqCst);
                std::thread::sleep(Duration::from_micros(index as u64 * 7919 % 500));
                Ok(index)
            };
            let take = |index| {
                held.fetch_sub(1, Ordering::SeqCst);
                taken.push(index);
                Ok(())
            };
            assert_eq!(pool(threads).install(|| in_order(200, ahead, make, take)), Ok(()));
            assert_eq!(taken, (0..200).collect::<Vec<_>>(), "{threads} threads, {ahead} ahead");
            let most = most.into_inner();
            assert!(most <= ahead, "{most} held, {ahead} allowed");
        }
    }

    #[test]
    fn work_that_is_itself_parallel_comes_to_an_end() {
        use rayon::prelude::*;
        let make = |index: usize| -> Result<u64, ()> {
            Ok((0..1000u64).into_par_iter().map(|k| k * index as u64).sum())
        };
        let mut sum = 0;
        let take = |part: u64| {
            sum += (0..100u64).into_par_iter().map(|_| part).sum::<u64>();
            Ok(())
        };
        assert_eq!(pool(3).install(|| in_order(300, 4, make, take)), Ok(()));
        assert_eq!(sum, 100 * 499_500 * (0..300).sum::<u64>());
    }

    #[test]
    fn the_first_error_by_place_ends_it() {
        let mut taken = 0;
        let make = |index: usize| match index {
            20 => {
                std::thread::sleep(Duration::from_millis(20));
                Err(index)
            }
            21 => Err(index),
            _ => Ok(index),
        };
        let take = |_| {
            taken += 1;
            Ok(())
        };
        assert_eq!(pool(4).install(|| in_order(100, 8, make, take)), Err(20));
        assert_eq!(taken, 20);
        let take = |index| if index == 7 { Err(index) } else { Ok(()) };
        assert_eq!(pool(4).install(|| in_order(100, 8, Ok, take)), Err(7));
        assert_eq!(in_order(0, 3, Ok::<usize, usize>, |_| Ok(())), Ok(()));
    }
}
