//! Which store a command is about, and how many cases it computes at a time.

use super::Output;
use crate::api::Error;
use crate::campaign::Campaign;
use crate::store::{Store, StoreSource};
use std::io::Write as _;
use std::num::NonZeroUsize;
use std::path::{Path, PathBuf};

/// A store, or the campaign file it belongs to.
#[derive(Debug, clap::Args)]
pub(crate) struct StoreArguments {
    /// The campaign file, which stands for what it asks for now; or its store, which stands for what it was last run with
    #[arg(value_name = "FILE")]
    pub(crate) file: PathBuf,
    /// The store of the campaign file [default: results/NAME.sqlite in the folder that holds `sweeps/`, or beside the file]
    #[arg(long, value_name = "STORE")]
    store: Option<PathBuf>,
}

impl StoreArguments {
    /// One of several stores: a campaign file, whose store has its usual place, or a store.
    pub(super) fn of(file: PathBuf) -> Self {
        Self { file, store: None }
    }

    /// Finds the store, and reads the campaign file if one is given.
    pub(crate) fn find(&self) -> Result<StoreSource, Error> {
        if !is_campaign_file(&self.file) {
            if self.store.is_some() {
                return Err(Error::Argument {
                    argument: "--store",
                    message: format!(
                        "it goes with a campaign file, whose name ends with .toml; {} is taken for a store itself",
                        self.file.display()
                    ),
                });
            }
            return Ok(StoreSource::new(whole(&self.file)?, None));
        }
        let campaign = Campaign::read(&self.file)?;
        Ok(StoreSource::new(
            store_of(&campaign, self.store.as_deref())?,
            Some(campaign),
        ))
    }

    /// The same, to show one of the segments of its runs, by its number from 1, where one is asked for.
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

    /// Opens the store for reading, and says so if it was last run with another version of the campaign file given.
    pub(crate) fn open(&self, output: &Output<'_>) -> Result<Store, Error> {
        let store = self.find()?.open()?;
        print_warning(&store);
        print_last_run(&store, output);
        Ok(store)
    }
}

/// The store of a campaign: the one named, or its usual one.
pub(crate) fn store_of(campaign: &Campaign, named: Option<&Path>) -> Result<PathBuf, Error> {
    named.map_or_else(|| Ok(campaign.default_store()), whole)
}

/// Most threads; more are taken for a typo.
const WORKER_LIMIT: usize = 4096;

/// Reads how many cases are computed at a time.
pub(super) fn workers(text: &str) -> Result<NonZeroUsize, String> {
    let number = text.trim().parse().ok();
    number
        .filter(|workers: &NonZeroUsize| workers.get() <= WORKER_LIMIT)
        .ok_or_else(|| {
            format!("write a number from 1 to {WORKER_LIMIT}, or leave it out for all cores")
        })
}

/// Reads a number of things of which there is at least one.
pub(super) fn positive(text: &str) -> Result<NonZeroUsize, String> {
    let number = text.trim().parse().ok();
    number.ok_or_else(|| "write a whole number from 1".to_owned())
}

/// As many workers as were asked for, or one for each core.
pub(super) fn workers_or_all(asked: Option<NonZeroUsize>) -> usize {
    asked
        .or_else(|| std::thread::available_parallelism().ok())
        .map_or(1, NonZeroUsize::get)
}

/// Whether a name is that of a campaign file.
pub(crate) fn is_campaign_file(path: &Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension == "toml")
}

/// The whole path of a file, as messages name it.
fn whole(path: &Path) -> Result<PathBuf, Error> {
    std::path::absolute(path).map_err(|source| Error::Read {
        path: path.to_owned(),
        source,
    })
}

/// Says on standard error what whoever opened a store must know, wanted or not: changes that are lost with a damaged log.
pub(super) fn print_warning(store: &Store) {
    if let Some(warning) = store.warning() {
        // Nobody may read standard error.
        let _ = writeln!(crate::text::visible::stderr(), "warning: {warning}");
    }
}

/// Says that a store was last run with another version of the campaign file than the one it is shown for.
pub(super) fn print_last_run(store: &Store, output: &Output<'_>) {
    if let Some(file) = store.last_run_with() {
        output.note(&format!(
            "the store {} was last run with another version of the campaign, of {}: shown is what the file given asks for",
            store.path().display(),
            file.display()
        ));
    }
}
