-- Who may do what.
create table account (
    account_id text not null primary key,
    name text not null,
    -- The name in lower case: 'Ann' and 'ann' are one person.
    name_key text not null,
    password_hash text not null,
    role text not null check (role in ('admin', 'seller')),
    disabled boolean not null default false,
    created_at bigint not null,
    updated_at bigint not null,
    constraint account_name_key unique (name_key)
);

-- Only the SHA-256 of a session id is kept: who reads the database cannot take over a session.
create table session (
    session_hash text not null primary key,
    account_id text not null references account (account_id) on delete cascade,
    created_at bigint not null,
    seen_at bigint not null,
    expires_at bigint not null
);
create index session_account on session (account_id);

create table token (
    token_id text not null primary key,
    account_id text not null references account (account_id) on delete cascade,
    name text not null,
    -- The first characters, so that people can tell their tokens apart.
    prefix text not null,
    token_hash text not null unique,
    -- Words with a space between.
    scopes text not null,
    created_at bigint not null,
    expires_at bigint,
    last_used_at bigint
);
create index token_account on token (account_id);

-- The one-time link for the first admin: at most one row, gone when used.
create table setup_link (
    link_hash text not null primary key,
    created_at bigint not null
);

create table product (
    product_id text not null primary key,
    owner_id text not null references account (account_id),
    title text not null,
    description text not null,
    -- Title and description in lower case (full Unicode, which the database's own lower() is not).
    search_text text not null,
    price_minor bigint,
    currency text,
    category text not null,
    condition text,
    status text not null check (status in ('draft', 'active', 'archived')),
    -- Counts every change; the ETag of the product.
    version bigint not null,
    -- What was found in the model and in the report, as JSON; null without one.
    model_info text,
    scan_info text,
    created_at bigint not null,
    updated_at bigint not null,
    constraint product_price check ((price_minor is null) = (currency is null))
);
create index product_owner on product (owner_id, product_id);
create index product_status on product (status, product_id);

-- Files of a product; the bytes are in the storage under their SHA-256.
create table product_file (
    product_id text not null references product (product_id) on delete cascade,
    role text not null check (role in ('model', 'stream', 'poster', 'thumb', 'report')),
    sha256 text not null,
    name text not null,
    bytes bigint not null,
    -- Drawn by the server, and so replaced by anything the seller sends.
    generated boolean not null default false,
    created_at bigint not null,
    primary key (product_id, role)
);
create index product_file_sha256 on product_file (sha256);

-- Resumable uploads; the bytes so far are in the spool folder under the id.
create table upload (
    upload_id text not null primary key,
    account_id text not null references account (account_id) on delete cascade,
    product_id text not null references product (product_id) on delete cascade,
    kind text not null check (kind in ('model', 'poster', 'report')),
    filename text not null,
    sha256 text,
    length bigint not null,
    state text not null check (state in ('receiving', 'done', 'failed')),
    detail text,
    created_at bigint not null,
    expires_at bigint not null
);
create index upload_expires on upload (expires_at);
