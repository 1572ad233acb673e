//! Stores are read as files of strangers.

use rusqlite::Connection;
use rusqlite::config::DbConfig;

/// Largest text or blob that is read, in bytes.
const LENGTH_LIMIT: i32 = 256 << 20;

/// Lets nothing that is written in a store be carried out: no views, no triggers, no functions but those without effect.
pub(super) fn harden(connection: &Connection) -> rusqlite::Result<()> {
    for (option, value) in [
        (DbConfig::SQLITE_DBCONFIG_TRUSTED_SCHEMA, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_TRIGGER, false),
        (DbConfig::SQLITE_DBCONFIG_ENABLE_VIEW, false),
        (DbConfig::SQLITE_DBCONFIG_DEFENSIVE, true),
    ] {
        connection.set_db_config(option, value)?;
    }
    connection.set_prepared_statement_cache_capacity(64);
    connection.set_limit(rusqlite::limits::Limit::SQLITE_LIMIT_LENGTH, LENGTH_LIMIT)?;
    Ok(())
}
