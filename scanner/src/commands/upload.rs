//! `scan-product upload`.

use std::path::PathBuf;

use anyhow::{Context, bail};
use serde_json::json;

use crate::cli::DONE;
use crate::ui::Ui;
use crate::upload::{Destination, Listing, Token, publish};

/// The variable that may hold the token.
const TOKEN_VARIABLE: &str = "ALLROUND_TOKEN";

/// Arguments.
#[derive(Debug, clap::Args)]
#[command(after_help = "\
The upload token is read from the environment variable ALLROUND_TOKEN or from --token-file, and is never shown.
Make one on the server's page of tokens, with the scope `upload`.

When the connection breaks, run the same command again: it goes on where it stopped.")]
pub struct Args {
    /// Folder that `scan-product build` wrote
    #[arg(value_name = "OUT")]
    pub folder: PathBuf,
    /// The product server, as https://shop.example
    #[arg(long, value_name = "URL")]
    pub server: String,
    /// Title of the listing
    #[arg(long)]
    pub title: String,
    /// Description of the listing
    #[arg(long)]
    pub description: Option<String>,
    /// Price, as 25.00
    #[arg(long, requires = "currency")]
    pub price: Option<String>,
    /// Currency of the price, as EUR
    #[arg(long, requires = "price")]
    pub currency: Option<String>,
    /// What kind of thing it is
    #[arg(long, value_parser = ["home", "electronics", "clothing", "toys", "sport", "books", "garden", "other"])]
    pub category: Option<String>,
    /// How worn it is
    #[arg(long, value_parser = ["new", "like_new", "good", "fair", "poor"])]
    pub condition: Option<String>,
    /// File that holds the upload token
    #[arg(long, value_name = "FILE")]
    pub token_file: Option<PathBuf>,
}

/// Runs the command.
pub fn run(args: &Args, ui: &Ui) -> anyhow::Result<u8> {
    let listing = Listing {
        title: args.title.clone(),
        description: args.description.clone(),
        price: price(args.price.as_deref(), args.currency.as_deref())?,
        category: args.category.clone(),
        condition: args.condition.clone(),
    };
    let token = Token::new(&token_text(args)?)?;
    if args.server.starts_with("http://") && !is_this_machine(&args.server) {
        ui.warn(
            "the server is reached without encryption: others on the way can read the token; use https://",
        );
    }
    let published = publish(&args.folder, &Destination::new(&args.server, token), &listing, ui)?;
    let next = if published.status == "draft" { " (a draft until an admin activates it)" } else { "" };
    ui.result(
        &format!("{}{next}", published.url),
        &json!({
            "product_id": published.product_id,
            "url": published.url,
            "status": published.status,
            "sha256": published.sha256,
        }),
    );
    Ok(DONE)
}

fn token_text(args: &Args) -> anyhow::Result<String> {
    if let Some(file) = &args.token_file {
        return std::fs::read_to_string(file)
            .with_context(|| format!("cannot read the token file {}", file.display()));
    }
    match std::env::var(TOKEN_VARIABLE) {
        Ok(text) => Ok(text),
        Err(_) => bail!("no upload token: set {TOKEN_VARIABLE} or give --token-file"),
    }
}

fn is_this_machine(server: &str) -> bool {
    let host = server.trim_start_matches("http://");
    ["localhost", "127.", "[::1]"].iter().any(|local| host.starts_with(local))
}

/// Digits after the point of a currency (ISO 4217).
fn decimals(currency: &str) -> usize {
    match currency {
        "BIF" | "CLP" | "DJF" | "GNF" | "ISK" | "JPY" | "KMF" | "KRW" | "PYG" | "RWF" | "UGX" | "UYI"
        | "VND" | "VUV" | "XAF" | "XOF" | "XPF" => 0,
        "BHD" | "IQD" | "JOD" | "KWD" | "LYD" | "OMR" | "TND" => 3,
        _ => 2,
    }
}

/// `25`, `25.5` and `25.50` in smallest units.
fn price(amount: Option<&str>, currency: Option<&str>) -> anyhow::Result<Option<(i64, String)>> {
    let (Some(amount), Some(currency)) = (amount, currency) else { return Ok(None) };
    let currency = currency.to_ascii_uppercase();
    if currency.len() != 3 || !currency.bytes().all(|b| b.is_ascii_uppercase()) {
        bail!("--currency {currency:?} is not three letters, as EUR");
    }
    let places = decimals(&currency);
    let (whole, part) = amount.split_once('.').unwrap_or((amount, ""));
    let digits = |text: &str| text.bytes().all(|b| b.is_ascii_digit());
    if whole.is_empty() || !digits(whole) || !digits(part) || part.len() > places || amount.ends_with('.') {
        bail!(
            "--price {amount:?} is not an amount of {currency}; write it with at most {places} digits after a point"
        );
    }
    let minor = format!("{whole}{part:0<places$}").parse().context("--price is absurdly large")?;
    Ok(Some((minor, currency)))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn prices_in_smallest_units() {
        let check = |amount, currency, expected: Option<i64>| {
            let found = price(Some(amount), Some(currency)).ok().flatten().map(|(minor, _)| minor);
            assert_eq!(found, expected, "{amount} {currency}");
        };
        check("25.00", "EUR", Some(2500));
        check("25", "eur", Some(2500));
        check("25.5", "EUR", Some(2550));
        check("0.05", "EUR", Some(5));
        check("2500", "JPY", Some(2500));
        check("1.234", "KWD", Some(1234));
        for bad in ["", ".", "25.", ".5", "-1", "1,5", "1e3", "25.005", "99999999999999999999"] {
            check(bad, "EUR", None);
        }
        check("1.5", "JPY", None);
        check("1", "EURO", None);
    }
}
