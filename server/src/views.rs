//! Listings as the outside sees them.

use serde::Serialize;
use utoipa::ToSchema;

use crate::db::product::{FileRow, ProductRow};
use crate::model::{Category, Condition, FileRole, ModelKind, ScanInfo, Status, Verdict, rfc3339};

/// A listing in a gallery.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ProductCard {
    pub id: String,
    pub title: String,
    /// In the currency's smallest unit; null together with `currency`.
    #[schema(required)]
    pub price_minor: Option<i64>,
    /// ISO 4217.
    #[schema(required)]
    pub currency: Option<String>,
    pub category: Category,
    /// Null: not stated.
    #[schema(required)]
    pub condition: Option<Condition>,
    /// JPEG of at most 15 kB.
    #[schema(required)]
    pub thumb_url: Option<String>,
    pub has_model: bool,
    /// Length, width, height in metres, from the scanner's report.
    #[schema(required)]
    pub dimensions_m: Option<[f64; 3]>,
    #[schema(required)]
    pub verdict: Option<Verdict>,
    pub created_at: String,
}

/// A listing in the owner's or the admin's table.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ManagedCard {
    #[serde(flatten)]
    pub card: ProductCard,
    pub status: Status,
    pub owner: Owner,
    pub version: i64,
    pub updated_at: String,
}

/// Whose listing it is.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Owner {
    pub id: String,
    pub name: String,
}

/// One listing with everything about it.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Product {
    #[serde(flatten)]
    pub card: ProductCard,
    pub description: String,
    pub status: Status,
    pub owner: Owner,
    /// Counts every change; also in the ETag, `"v3"`.
    pub version: i64,
    pub updated_at: String,
    /// JPEG of at most 60 kB.
    #[schema(required)]
    pub poster_url: Option<String>,
    #[schema(required)]
    pub model: Option<ProductModel>,
    #[schema(required)]
    pub scan: Option<ProductScan>,
}

/// The 3D model of a listing.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ProductModel {
    pub kind: ModelKind,
    pub points: u64,
    pub triangles: u64,
    /// The viewer stream, ARS1.
    pub stream_url: String,
    pub stream_bytes: i64,
    /// The file as it was uploaded.
    pub original_url: String,
    pub original_name: String,
    pub original_bytes: i64,
    /// Of the original.
    pub sha256: String,
    pub bounds_m: Bounds,
}

/// Lowest and highest coordinates, metres, z up.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct Bounds {
    pub min: [f32; 3],
    pub max: [f32; 3],
}

/// What the scanner's report says.
#[derive(Debug, Clone, Serialize, ToSchema)]
pub struct ProductScan {
    #[schema(required)]
    pub dimensions_m: Option<[f64; 3]>,
    #[schema(required)]
    pub dimensions_uncertainty_m: Option<[f64; 3]>,
    #[schema(required)]
    pub verdict: Option<Verdict>,
    pub views_used: u64,
    pub views_total: u64,
    pub warnings: Vec<String>,
    #[schema(required)]
    pub software: Option<String>,
    pub report_url: String,
}

/// Where a file of a product is served.
pub fn file_url(product_id: &str, sha256: &str, name: &str) -> String {
    format!("/api/products/{product_id}/files/{sha256}/{name}")
}

impl From<&ProductRow> for ProductCard {
    fn from(row: &ProductRow) -> Self {
        let (price_minor, currency) = row.text.price.clone().unzip();
        Self {
            id: row.id.clone(),
            title: row.text.title.clone(),
            price_minor,
            currency,
            category: row.text.category,
            condition: row.text.condition,
            thumb_url: row.thumb_sha256.as_deref().map(|sha| file_url(&row.id, sha, "thumb.jpg")),
            has_model: row.model.is_some(),
            dimensions_m: row.scan.as_ref().and_then(|scan| scan.dimensions_m),
            verdict: row.scan.as_ref().and_then(|scan| scan.verdict),
            created_at: rfc3339(row.created_at),
        }
    }
}

impl From<&ProductRow> for ManagedCard {
    fn from(row: &ProductRow) -> Self {
        Self {
            card: row.into(),
            status: row.status,
            owner: owner(row),
            version: row.version,
            updated_at: rfc3339(row.updated_at),
        }
    }
}

fn owner(row: &ProductRow) -> Owner {
    Owner { id: row.owner_id.clone(), name: row.owner_name.clone() }
}

impl Product {
    /// Put together from the listing and its files.
    pub fn new(row: &ProductRow, files: &[FileRow]) -> Self {
        let file = |role| files.iter().find(|file| file.role == role);
        let url = |file: &FileRow| file_url(&row.id, &file.sha256, &file.name);
        Self {
            card: row.into(),
            description: row.text.description.clone(),
            status: row.status,
            owner: owner(row),
            version: row.version,
            updated_at: rfc3339(row.updated_at),
            poster_url: file(FileRole::Poster).map(url),
            model: model(row, file(FileRole::Model), file(FileRole::Stream)),
            scan: row
                .scan
                .as_ref()
                .zip(file(FileRole::Report))
                .map(|(scan, file)| product_scan(scan, url(file))),
        }
    }
}

fn model(row: &ProductRow, original: Option<&FileRow>, stream: Option<&FileRow>) -> Option<ProductModel> {
    let (info, original, stream) = (row.model.as_ref()?, original?, stream?);
    Some(ProductModel {
        kind: info.kind,
        points: info.points,
        triangles: info.triangles,
        stream_url: file_url(&row.id, &stream.sha256, &stream.name),
        stream_bytes: stream.bytes,
        original_url: file_url(&row.id, &original.sha256, &original.name),
        original_name: original.name.clone(),
        original_bytes: original.bytes,
        sha256: original.sha256.clone(),
        bounds_m: Bounds { min: info.min, max: info.max },
    })
}

fn product_scan(scan: &ScanInfo, report_url: String) -> ProductScan {
    ProductScan {
        dimensions_m: scan.dimensions_m,
        dimensions_uncertainty_m: scan.dimensions_uncertainty_m,
        verdict: scan.verdict,
        views_used: scan.views_used,
        views_total: scan.views_total,
        warnings: scan.warnings.clone(),
        software: scan.software.clone(),
        report_url,
    }
}
