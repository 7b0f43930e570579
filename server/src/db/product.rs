//! Listings and their files.

use sqlx::Row;

use super::{Db, DbResult, DbRow, Tx, now_micros};
use crate::model::{Category, Condition, FileRole, ModelInfo, ScanInfo, Status, Word};

/// A listing as it is stored, with its owner's name and its small picture.
#[derive(Debug, Clone)]
pub struct ProductRow {
    pub id: String,
    pub owner_id: String,
    pub owner_name: String,
    pub text: ProductText,
    pub status: Status,
    pub version: i64,
    pub model: Option<ModelInfo>,
    pub scan: Option<ScanInfo>,
    pub created_at: i64,
    pub updated_at: i64,
    pub thumb_sha256: Option<String>,
}

/// What people write about a product.
#[derive(Debug, Clone, PartialEq)]
pub struct ProductText {
    pub title: String,
    pub description: String,
    pub price: Option<(i64, String)>,
    pub category: Category,
    pub condition: Option<Condition>,
}

/// A file of a product.
#[derive(Debug, Clone)]
pub struct FileRow {
    pub role: FileRole,
    pub sha256: String,
    pub name: String,
    pub bytes: i64,
    pub generated: bool,
}

/// Which listings are wanted.
#[derive(Debug, Default)]
pub struct ProductFilter {
    pub words: Option<String>,
    pub category: Option<Category>,
    pub status: Option<Status>,
    pub owner_id: Option<String>,
    pub order: Order,
    pub limit: i64,
    pub offset: i64,
}

/// In which order.
#[derive(Debug, Default, Clone, Copy)]
pub enum Order {
    #[default]
    Newest,
    PriceAscending,
    PriceDescending,
}

/// What new files tell about the product.
#[derive(Debug)]
pub enum NewInfo {
    Model(ModelInfo),
    Scan(ScanInfo),
    Picture,
}

const SELECT: &str = "select p.*, a.name as owner_name, t.sha256 as thumb_sha256 from product p
    join account a on a.account_id = p.owner_id
    left join product_file t on t.product_id = p.product_id and t.role = 'thumb'";

const WHERE: &str = " where (cast($1 as text) is null or p.search_text like $1 escape '\\')
    and (cast($2 as text) is null or p.category = $2)
    and (cast($3 as text) is null or p.status = $3)
    and (cast($4 as text) is null or p.owner_id = $4)";

fn product(row: &DbRow) -> DbResult<ProductRow> {
    let (price, currency): (Option<i64>, Option<String>) =
        (row.try_get("price_minor")?, row.try_get("currency")?);
    let condition: Option<String> = row.try_get("condition")?;
    Ok(ProductRow {
        id: row.try_get("product_id")?,
        owner_id: row.try_get("owner_id")?,
        owner_name: row.try_get("owner_name")?,
        text: ProductText {
            title: row.try_get("title")?,
            description: row.try_get("description")?,
            price: price.zip(currency),
            category: super::word(row, "category")?,
            condition: condition.as_deref().and_then(Condition::from_word),
        },
        status: super::word(row, "status")?,
        version: row.try_get("version")?,
        model: super::json(row, "model_info")?,
        scan: super::json(row, "scan_info")?,
        created_at: row.try_get("created_at")?,
        updated_at: row.try_get("updated_at")?,
        thumb_sha256: row.try_get("thumb_sha256")?,
    })
}

fn file(row: &DbRow) -> DbResult<FileRow> {
    Ok(FileRow {
        role: super::word(row, "role")?,
        sha256: row.try_get("sha256")?,
        name: row.try_get("name")?,
        bytes: row.try_get("bytes")?,
        generated: row.try_get("generated")?,
    })
}

impl Db {
    pub async fn product(&self, id: &str) -> DbResult<Option<ProductRow>> {
        let sql = super::from_pieces(format!("{SELECT} where p.product_id = $1"));
        sqlx::query(sql).bind(id).fetch_optional(self.reader()).await?.as_ref().map(product).transpose()
    }

    /// A page of listings, and how many there are in all.
    pub async fn products(&self, filter: &ProductFilter) -> DbResult<(Vec<ProductRow>, i64)> {
        let order = match filter.order {
            Order::Newest => "p.product_id desc",
            Order::PriceAscending => "p.price_minor is null, p.price_minor, p.product_id desc",
            Order::PriceDescending => "p.price_minor is null, p.price_minor desc, p.product_id desc",
        };
        let words = filter.words.as_deref().filter(|w| !w.trim().is_empty()).map(super::like_pattern);
        let (category, status) = (filter.category.map(Category::word), filter.status.map(Status::word));
        let count = super::from_pieces(format!("select count(*) as n from product p{WHERE}"));
        let total = sqlx::query(count)
            .bind(&words)
            .bind(category)
            .bind(status)
            .bind(&filter.owner_id)
            .fetch_one(self.reader())
            .await?
            .try_get("n")?;
        let page = super::from_pieces(format!("{SELECT}{WHERE} order by {order} limit $5 offset $6"));
        let rows = sqlx::query(page)
            .bind(&words)
            .bind(category)
            .bind(status)
            .bind(&filter.owner_id)
            .bind(filter.limit)
            .bind(filter.offset)
            .fetch_all(self.reader())
            .await?;
        Ok((rows.iter().map(product).collect::<DbResult<_>>()?, total))
    }

    /// How many public listings each category has; categories without one are left out.
    pub async fn categories(&self) -> DbResult<Vec<(Category, i64)>> {
        let sql = "select category, count(*) as n from product where status = 'active'
                   group by category order by category";
        let rows = sqlx::query(sql).fetch_all(self.reader()).await?;
        rows.iter().map(|row| Ok((super::word(row, "category")?, row.try_get("n")?))).collect()
    }

    /// Makes a draft; returns its id.
    pub async fn insert_product(&self, owner_id: &str, text: &ProductText) -> DbResult<String> {
        let id = crate::model::new_id();
        let (price, currency) = text.price.clone().unzip();
        sqlx::query(
            "insert into product (product_id, owner_id, title, description, search_text, price_minor, currency,
             category, condition, status, version, created_at, updated_at)
             values ($1, $2, $3, $4, $5, $6, $7, $8, $9, 'draft', 1, $10, $10)",
        )
        .bind(&id)
        .bind(owner_id)
        .bind(&text.title)
        .bind(&text.description)
        .bind(search_text(text))
        .bind(price)
        .bind(currency)
        .bind(text.category.word())
        .bind(text.condition.map(Condition::word))
        .bind(now_micros())
        .execute(self.writer())
        .await?;
        Ok(id)
    }

    /// Changes the text of exactly this version; `false` where somebody was quicker.
    pub async fn edit_product(&self, id: &str, version: i64, text: &ProductText) -> DbResult<bool> {
        let (price, currency) = text.price.clone().unzip();
        let update = sqlx::query(
            "update product set title = $3, description = $4, search_text = $5, price_minor = $6, currency = $7,
             category = $8, condition = $9, version = version + 1, updated_at = $10
             where product_id = $1 and version = $2",
        )
        .bind(id)
        .bind(version)
        .bind(&text.title)
        .bind(&text.description)
        .bind(search_text(text))
        .bind(price)
        .bind(currency)
        .bind(text.category.word())
        .bind(text.condition.map(Condition::word))
        .bind(now_micros());
        Ok(update.execute(self.writer()).await?.rows_affected() > 0)
    }

    /// Sets the status; `false` where it may not be set: active needs a model.
    pub async fn set_status(&self, id: &str, status: Status) -> DbResult<bool> {
        let update = sqlx::query(
            "update product set status = $2, version = version + 1, updated_at = $3
             where product_id = $1 and ($2 <> 'active' or model_info is not null)",
        );
        let update = update.bind(id).bind(status.word()).bind(now_micros());
        Ok(update.execute(self.writer()).await?.rows_affected() > 0)
    }

    /// Deletes a listing that is not active; returns the keys nobody uses any more, `None` where it is active.
    pub async fn delete_product(&self, id: &str) -> DbResult<Option<Vec<String>>> {
        let mut tx = self.begin().await?;
        let files = files_of(&mut tx, id).await?;
        let delete = sqlx::query("delete from product where product_id = $1 and status <> 'active'");
        if delete.bind(id).execute(&mut *tx).await?.rows_affected() == 0 {
            return Ok(None);
        }
        let unused = unused(&mut tx, files.into_iter().map(|f| f.sha256).collect()).await?;
        tx.commit().await?;
        Ok(Some(unused))
    }

    /// All files of a product.
    pub async fn files(&self, id: &str) -> DbResult<Vec<FileRow>> {
        let query = sqlx::query("select * from product_file where product_id = $1 order by role").bind(id);
        query.fetch_all(self.reader()).await?.iter().map(file).collect()
    }

    /// Puts files in the place of those with the same role; returns the keys nobody uses any more, `None` where the product
    /// is gone.
    pub async fn attach(&self, id: &str, files: &[FileRow], info: &NewInfo) -> DbResult<Option<Vec<String>>> {
        let mut tx = self.begin().await?;
        let (model, scan) = match info {
            NewInfo::Model(model) => (serde_json::to_string(model).ok(), None),
            NewInfo::Scan(scan) => (None, serde_json::to_string(scan).ok()),
            NewInfo::Picture => (None, None),
        };
        let update = sqlx::query(
            "update product set model_info = coalesce($2, model_info), scan_info = coalesce($3, scan_info),
             version = version + 1, updated_at = $4 where product_id = $1",
        );
        let update = update.bind(id).bind(model).bind(scan).bind(now_micros());
        if update.execute(&mut *tx).await?.rows_affected() == 0 {
            return Ok(None);
        }
        let before = files_of(&mut tx, id).await?;
        for file in files {
            replace_file(&mut tx, id, file).await?;
        }
        let unused = unused(&mut tx, before.into_iter().map(|f| f.sha256).collect()).await?;
        tx.commit().await?;
        Ok(Some(unused))
    }

    /// Whether any product uses these bytes.
    pub async fn is_used(&self, sha256: &str) -> DbResult<bool> {
        let query = sqlx::query("select 1 from product_file where sha256 = $1 limit 1").bind(sha256);
        Ok(query.fetch_optional(self.writer()).await?.is_some())
    }
}

fn search_text(text: &ProductText) -> String {
    format!("{}\n{}", text.title, text.description).to_lowercase()
}

async fn files_of(tx: &mut Tx, id: &str) -> DbResult<Vec<FileRow>> {
    let query = sqlx::query("select * from product_file where product_id = $1").bind(id);
    query.fetch_all(&mut **tx).await?.iter().map(file).collect()
}

async fn replace_file(tx: &mut Tx, id: &str, file: &FileRow) -> DbResult<()> {
    let delete = sqlx::query("delete from product_file where product_id = $1 and role = $2");
    delete.bind(id).bind(file.role.word()).execute(&mut **tx).await?;
    sqlx::query(
        "insert into product_file (product_id, role, sha256, name, bytes, generated, created_at)
         values ($1, $2, $3, $4, $5, $6, $7)",
    )
    .bind(id)
    .bind(file.role.word())
    .bind(&file.sha256)
    .bind(&file.name)
    .bind(file.bytes)
    .bind(file.generated)
    .bind(now_micros())
    .execute(&mut **tx)
    .await?;
    Ok(())
}

async fn unused(tx: &mut Tx, keys: Vec<String>) -> DbResult<Vec<String>> {
    let mut unused = Vec::new();
    for key in keys {
        let query = sqlx::query("select 1 from product_file where sha256 = $1 limit 1").bind(&key);
        if query.fetch_optional(&mut **tx).await?.is_none() {
            unused.push(key);
        }
    }
    Ok(unused)
}
