//! Threads that compute one run together.
//!
//! Work is divided among the threads of a [`Threads`] only where the result does not depend on the
//! division: every sphere, pair, line or block of a factor is computed by one thread, and sums have
//! the same order as on one. So a run has the same bits with any number of threads. Code outside a
//! [`Threads::run`] computes on its own thread, in whatever pool that is.

use crate::error::Error;
use std::cell::Cell;
use std::num::NonZeroUsize;
use std::ops::Range;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

/// Most parts of a list that needs no workspace.
const MOST_PARTS: usize = 64;
/// Number of times that a thread without work looks for it without a pause, some 0.2 ms.
const EAGER_LOOKS: u32 = 400;
/// Pause between later ones.
const PAUSE: Duration = Duration::from_micros(100);

thread_local! {
    /// Number of threads that compute together with this one, itself included.
    static TOGETHER: Cell<usize> = const { Cell::new(1) };
    /// Number of threads that stay awake with this one: no more than there are other cores.
    static AWAKE: Cell<usize> = const { Cell::new(0) };
    /// Number of divided works, each within the one before, of which this thread computes a part.
    static DEPTH: Cell<u32> = const { Cell::new(0) };
    /// Whether even the smallest work is divided.
    static DIVIDES_ALL: Cell<bool> = const { Cell::new(false) };
}

/// Threads that compute one run together, and wait between runs.
///
/// ```
/// use sd_core::Threads;
///
/// let threads = Threads::new(2)?;
/// assert_eq!(threads.run(|| 6 * 7), 42);
/// # Ok::<(), sd_core::Error>(())
/// ```
#[derive(Debug)]
pub struct Threads {
    /// None where there is one thread, that of the caller.
    pool: Option<rayon::ThreadPool>,
}

impl Threads {
    /// Starts the threads; none for `count` ≤ 1.
    ///
    /// # Errors
    /// [`Error::Threads`].
    pub fn new(count: usize) -> Result<Self, Error> {
        Self::start(count, false)
    }

    fn start(count: usize, divides_all: bool) -> Result<Self, Error> {
        if count <= 1 {
            return Ok(Self { pool: None });
        }
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .thread_name(|number| format!("run {number}"))
            .start_handler(move |_| {
                TOGETHER.set(count);
                AWAKE.set(count.min(cores) - 1);
                DIVIDES_ALL.set(divides_all);
            })
            .build();
        match pool {
            Ok(pool) => Ok(Self { pool: Some(pool) }),
            Err(error) => Err(Error::Threads {
                reason: error.to_string(),
            }),
        }
    }

    /// Number of threads.
    pub fn count(&self) -> usize {
        let pool = self.pool.as_ref();
        pool.map_or(1, rayon::ThreadPool::current_num_threads)
    }

    /// Computes a function, in which simulations divide their work among these threads.
    pub fn run<R: Send>(&self, work: impl FnOnce() -> R + Send) -> R {
        match &self.pool {
            Some(pool) => pool.install(work),
            None => work(),
        }
    }
}

/// Threads that divide even work that one of them would do sooner: for tests.
///
/// # Errors
/// Those of [`Threads::new`].
pub fn threads_for_small_work(count: usize) -> Result<Threads, Error> {
    Threads::start(count, true)
}

/// Number of threads that compute together with this one.
pub(crate) fn together() -> usize {
    TOGETHER.get()
}

/// Calls both functions, at the same time where there are threads.
pub(crate) fn both(first: impl FnOnce() + Send, second: impl FnOnce() + Send) {
    if together() > 1 {
        let depth = DEPTH.get();
        DEPTH.set(depth + 1);
        rayon::join(first, second);
        DEPTH.set(depth);
    } else {
        first();
        second();
    }
}

/// Computes a function during which the other threads wait for its divided works without falling
/// asleep: to wake one takes as long as many of these works.
pub(crate) fn keep_awake<R>(work: impl FnOnce() -> R) -> R {
    struct End<'a>(&'a AtomicBool);
    impl Drop for End<'_> {
        fn drop(&mut self) {
            self.0.store(true, Ordering::Release);
        }
    }
    let others = AWAKE.get();
    if others == 0 || DEPTH.get() > 0 {
        return work();
    }
    let ended = AtomicBool::new(false);
    rayon::in_place_scope(|scope| {
        for _ in 0..others {
            scope.spawn(|_| look_for_work(&ended));
        }
        let _end = End(&ended);
        work()
    })
}

/// Computes parts of works until all are ended. A thread that waits for another part of a work,
/// and finds this in place of it, returns to that.
fn look_for_work(ended: &AtomicBool) {
    let mut looks = 0;
    while DEPTH.get() == 0 && !ended.load(Ordering::Acquire) {
        if rayon::yield_now() == Some(rayon::Yield::Executed) {
            looks = 0;
        } else if looks < EAGER_LOOKS {
            looks += 1;
            std::thread::yield_now();
        } else {
            std::thread::sleep(PAUSE);
        }
    }
}

/// Number of parts into which work is divided, of `least` units or more each.
pub(crate) fn parts(units: usize, least: usize) -> usize {
    let least = if DIVIDES_ALL.get() { 1 } else { least };
    together().min(units / least).max(1)
}

/// Divides a list among the threads, in parts of `least` elements or more: `compute` gets the
/// number of the first element of a part, and the part.
pub(crate) fn divide<T: Send>(
    list: &mut [T],
    least: usize,
    compute: &(impl Fn(usize, &mut [T]) + Sync),
) {
    let mut none = [(); MOST_PARTS];
    let none = &mut none[..parts(list.len(), least).min(MOST_PARTS)];
    divide_with((list, 1), none, &|first, part, (): &mut ()| {
        compute(first, part);
    });
}

/// Divides a list of rows of a length among the threads, in as many parts as there are workspaces:
/// `compute` gets the number of the first row of a part, the part, and a workspace.
pub(crate) fn divide_with<T: Send, W: Send>(
    (list, length): (&mut [T], usize),
    workspaces: &mut [W],
    compute: &(impl Fn(usize, &mut [T], &mut W) + Sync),
) {
    divide_from(0, (list, length), workspaces, compute);
}

/// Lists what `find` finds in each part of so many units, in order; `others` is workspace.
pub(crate) fn gather<T: Copy + Send>(
    units: usize,
    least: usize,
    (list, others): (&mut Vec<T>, &mut Vec<Vec<T>>),
    find: &(impl Fn(Range<usize>, &mut Vec<T>) + Sync),
) {
    list.clear();
    let parts = parts(units, least).min(MOST_PARTS);
    if parts == 1 {
        return find(0..units, list);
    }
    others.resize_with(others.len().max(parts - 1), Vec::new);
    let others = &mut others[..parts - 1];
    let begin = |part: usize| units * part / parts;
    both(
        || find(0..begin(1), list),
        || {
            let mut none = [(); MOST_PARTS];
            let none = &mut none[..parts - 1];
            divide_with((others, 1), none, &|first, others, (): &mut ()| {
                for (part, other) in (first + 1..).zip(others) {
                    other.clear();
                    find(begin(part)..begin(part + 1), other);
                }
            });
        },
    );
    for other in others {
        list.extend_from_slice(other);
    }
}

fn divide_from<T: Send, W: Send>(
    first: usize,
    (list, length): (&mut [T], usize),
    workspaces: &mut [W],
    compute: &(impl Fn(usize, &mut [T], &mut W) + Sync),
) {
    if let [workspace] = workspaces {
        return compute(first, list, workspace);
    }
    let (parts, before) = (workspaces.len(), workspaces.len() / 2);
    let middle = list.len() / length * before / parts;
    let (left, right) = list.split_at_mut(middle * length);
    let (for_left, for_right) = workspaces.split_at_mut(before);
    both(
        || divide_from(first, (left, length), for_left, compute),
        || divide_from(first + middle, (right, length), for_right, compute),
    );
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::panic::AssertUnwindSafe;

    #[test]
    fn a_list_is_divided_without_gaps_and_small_ones_are_not() {
        for count in [1, 2, 3, 16] {
            let threads = Threads::new(count).unwrap();
            assert_eq!(threads.count(), count);
            threads.run(|| {
                assert_eq!(together(), count);
                for length in [0, 1, 9, 1000] {
                    let mut list = vec![(0, 0); length];
                    divide(&mut list, 10, &|first, part| {
                        let size = part.len();
                        for (k, entry) in part.iter_mut().enumerate() {
                            *entry = (first + k, size);
                        }
                    });
                    for (k, &(number, size)) in list.iter().enumerate() {
                        assert_eq!(number, k);
                        assert!(size >= 10 || size == length);
                        assert!(length < 1000 || size <= length.div_ceil(count));
                    }
                }
            });
        }
        assert_eq!(together(), 1);
    }

    #[test]
    fn parts_are_gathered_in_order() {
        for count in [1, 2, 3, 16] {
            Threads::new(count).unwrap().run(|| {
                for units in [0, 1, 9, 1000] {
                    let (mut list, mut others) = (vec![7], Vec::new());
                    for _ in 0..2 {
                        gather(units, 10, (&mut list, &mut others), &|range, list| {
                            list.extend(range.filter(|unit| unit % 3 == 0));
                        });
                        let expected: Vec<_> = (0..units).step_by(3).collect();
                        assert_eq!(list, expected);
                    }
                }
            });
        }
    }

    #[test]
    fn works_within_works_end_with_threads_kept_awake() {
        for count in [1, 2, 3, 16] {
            let threads = threads_for_small_work(count).unwrap();
            let sum = |list: &mut [u64]| {
                divide(list, 1, &|first, part| {
                    for (k, entry) in part.iter_mut().enumerate() {
                        let mut inner = [1; 20];
                        divide(&mut inner, 1, &|_, part| part.fill(2));
                        *entry = (first + k) as u64 + inner.iter().sum::<u64>();
                    }
                });
                list.iter().sum::<u64>()
            };
            let total = threads.run(|| {
                (0..200)
                    .map(|_| keep_awake(|| keep_awake(|| sum(&mut [0; 50]))))
                    .sum::<u64>()
            });
            assert_eq!(total, 200 * (50 * 40 + 49 * 25));
            let panics = AssertUnwindSafe(|| threads.run(|| keep_awake(|| panic!("no"))));
            let panics = std::panic::catch_unwind(panics);
            assert!(panics.is_err());
            assert_eq!(threads.run(|| keep_awake(|| sum(&mut [0; 2]))), 81);
        }
    }
}
