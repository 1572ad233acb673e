//! Threads that compute one run together.
//!
//! Work is divided among the threads of a [`Threads`] only where the result does not depend on the
//! division: every sphere, pair, line or block of a factor is computed by one thread, and sums have
//! the same order as on one. So a run has the same bits with any number of threads. Code outside a
//! [`Threads::run`] computes on its own thread, in whatever pool that is.

use crate::error::Error;
use std::cell::Cell;

/// Most parts of a list that needs no workspace.
const MOST_PARTS: usize = 64;

thread_local! {
    /// Number of threads that compute together with this one, itself included.
    static TOGETHER: Cell<usize> = const { Cell::new(1) };
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
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(count)
            .thread_name(|number| format!("run {number}"))
            .start_handler(move |_| {
                TOGETHER.set(count);
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
        rayon::join(first, second);
    } else {
        first();
        second();
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
}
