//! The store of a command, and the number of cases it computes in parallel.

use super::Output;
use crate::error::Error;
use crate::model::campaign::Campaign;
use crate::plan::threads_per_case;
use crate::store::{Store, StoreSource};
use crate::text::format::counted;
use std::io::Write as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// A store, or the campaign file it belongs to.
#[derive(Debug, clap::Args)]
pub(crate) struct StoreArguments {
    /// The campaign file in its present version, or its store with the version last run
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// The store of the campaign file [default: results/NAME.sqlite in the folder that holds
    /// `sweeps/`, or beside the file]
    #[arg(long, value_name = "STORE")]
    store: Option<PathBuf>,
}

impl StoreArguments {
    /// The files that it names.
    pub(super) fn files(&self) -> impl Iterator<Item = &Path> {
        std::iter::once(self.file.as_path()).chain(self.store.as_deref())
    }

    /// Finds the store, and reads the campaign file if one is given.
    pub(crate) fn find(&self) -> Result<StoreSource, Error> {
        if !is_campaign_file(&self.file) {
            if self.store.is_some() {
                return Err(Error::Argument {
                    argument: "--store",
                    message: format!(
                        "it belongs to a campaign file, whose name ends with .toml; {} is read as a store",
                        self.file.display()
                    ),
                });
            }
            return Ok(StoreSource::new(whole(&self.file)?, None));
        }
        let campaign = crate::campaign::read(&self.file)?;
        Ok(StoreSource::new(
            store_of(&campaign, self.store.as_deref())?,
            Some(campaign),
        ))
    }

    /// Opens the store for reading, restricted to one segment of its runs, by its number from 1, if
    /// given.
    pub(super) fn open_segment(
        &self,
        segment: Option<usize>,
        output: &Output<'_>,
    ) -> Result<Store, Error> {
        let Some(number) = segment else {
            return self.open(output);
        };
        let source = self.find()?;
        let store = source.open_segment(number)?;
        let store = store.map_err(|message| Error::Argument {
            argument: "--segment",
            message,
        })?;
        print_warning(&store);
        Ok(store)
    }

    /// Opens the store for reading, with a note if it was last run with another version of the
    /// campaign file.
    pub(crate) fn open(&self, output: &Output<'_>) -> Result<Store, Error> {
        let store = self.find()?.open()?;
        print_warning(&store);
        print_last_run(&store, &self.file, output);
        Ok(store)
    }
}

/// The store of a campaign: the one given, or its default.
pub(crate) fn store_of(campaign: &Campaign, named: Option<&Path>) -> Result<PathBuf, Error> {
    named.map_or_else(|| Ok(campaign.default_store()), whole)
}

/// Maximum number of threads; more are treated as a typo.
const WORKER_LIMIT: usize = 4096;

/// Reads the number of cases computed in parallel.
pub(super) fn workers(text: &str) -> Result<NonZeroUsize, String> {
    let number = text.trim().parse().ok();
    number
        .filter(|workers: &NonZeroUsize| workers.get() <= WORKER_LIMIT)
        .ok_or_else(|| format!("write a number from 1 to {WORKER_LIMIT}, or omit it for all cores"))
}

/// Reads a positive integer.
pub(super) fn positive(text: &str) -> Result<NonZeroUsize, String> {
    let number = text.trim().parse().ok();
    number.ok_or_else(|| "write a whole number from 1".to_owned())
}

/// How many workers a command has.
#[derive(Debug, clap::Args)]
pub(crate) struct WorkersArgument {
    /// Cases computed in parallel [default: the cores of the machine]
    #[arg(
        long,
        short,
        value_name = "N",
        visible_alias = "jobs",
        visible_short_alias = 'j',
        value_parser = workers
    )]
    workers: Option<NonZeroUsize>,
}

impl WorkersArgument {
    /// Those asked for, or as many as the machine has cores.
    pub(super) fn or_all(&self) -> usize {
        self.workers
            .or_else(|| std::thread::available_parallelism().ok())
            .map_or(1, NonZeroUsize::get)
    }
}

/// How many threads each case has.
#[derive(Debug, clap::Args)]
pub(crate) struct ThreadsArgument {
    /// Threads that compute one case together, with the same bits: for large systems [default: one,
    /// or more where there are fewer cases than cores]
    #[arg(long, value_name = "N", value_parser = workers)]
    threads_per_run: Option<NonZeroUsize>,
}

impl ThreadsArgument {
    /// Cases in parallel and threads in all, which are no more than the cores unless more cases are
    /// asked for; also a note where less is done than was asked for.
    pub(super) fn shared(
        &self,
        workers: &WorkersArgument,
        cases: usize,
    ) -> (usize, usize, Option<String>) {
        let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
        share(cores, workers.workers, self.threads_per_run, cases)
    }
}

/// [`ThreadsArgument::shared`] on a number of cores.
fn share(
    cores: usize,
    workers: Option<NonZeroUsize>,
    per_run: Option<NonZeroUsize>,
    cases: usize,
) -> (usize, usize, Option<String>) {
    let cases = cases.max(1);
    let Some(wanted) = per_run.map(NonZeroUsize::get) else {
        let asked = workers.map_or(cores, NonZeroUsize::get);
        let workers = asked.min(cases);
        let per_run = threads_per_case(cores, asked, cases);
        return (workers, workers * per_run, None);
    };
    let per_run = wanted.min(cores);
    let most = cores / per_run;
    let asked = workers.map_or(most, NonZeroUsize::get).min(cases);
    let workers = asked.min(most);
    let note = (wanted > per_run || asked > workers).then(|| {
        format!(
            "the machine has {}: {} in parallel with {} each",
            counted(cores, "core"),
            counted(workers, "case"),
            counted(per_run, "thread")
        )
    });
    (workers, workers * per_run, note)
}

/// Whether a name is that of a campaign file.
pub(crate) fn is_campaign_file(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "toml")
}

/// The absolute path of a file, for messages.
fn whole(path: &Path) -> Result<PathBuf, Error> {
    std::path::absolute(path).map_err(|source| Error::Read {
        path: path.to_owned(),
        source,
    })
}

/// Prints on standard error, even with `--quiet`, that changes were lost with a damaged log.
pub(super) fn print_warning(store: &Store) {
    if let Some(warning) = store.warning() {
        // Standard error may be closed.
        let _ = writeln!(crate::text::visible::stderr(), "warning: {warning}");
    }
}

/// Notes that a store was last run with another version of the campaign file given.
pub(super) fn print_last_run(store: &Store, file: &Path, output: &Output<'_>) {
    if let Some(last) = store.last_run_with() {
        output.note(&last_run(store.path(), last, file));
    }
}

/// That a store was last run with another version of the campaign file given.
pub(super) fn last_run(store: &Path, last: &Path, file: &Path) -> String {
    let is_same = std::path::absolute(file).is_ok_and(|file| file == last);
    let what = if is_same {
        format!(
            "before {} was changed, with another version of it; this shows it as it is now",
            file.display()
        )
    } else {
        format!(
            "with another version of the campaign, of {}; this shows {}",
            last.display(),
            file.display()
        )
    };
    format!("the store {} was last run {what}", store.display())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cases_times_threads_never_exceed_the_cores() {
        let some = NonZeroUsize::new;
        // Cores, workers, threads per run, cases: workers and all threads, whether with a note.
        for ((cores, workers, per_run, cases), (expected, threads, notes)) in [
            ((8, None, None, 100), (8, 8, false)),
            ((8, None, None, 3), (3, 6, false)),
            ((8, None, None, 1), (1, 8, false)),
            ((8, some(2), None, 1), (1, 2, false)),
            ((8, some(16), None, 100), (16, 16, false)),
            ((8, some(16), None, 1), (1, 8, false)),
            ((8, None, some(3), 100), (2, 6, false)),
            ((8, None, some(4), 1), (1, 4, false)),
            ((8, some(4), some(4), 100), (2, 8, true)),
            ((8, some(4), some(4), 2), (2, 8, false)),
            ((2, None, some(16), 5), (1, 2, true)),
            ((1, None, some(2), 1), (1, 1, true)),
        ] {
            let (found, all, note) = share(cores, workers, per_run, cases);
            assert_eq!((found, all, note.is_some()), (expected, threads, notes));
        }
    }
}
